//! Signal Temporal Logic: one tree and its evaluators.

mod tree;

pub use tree::{Axis, Clause, Comparison, Formula, Term};

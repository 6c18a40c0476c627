//! Signal Temporal Logic: one tree and its evaluators.
//!
//! [`compile`] resolves names and brings a [`Formula`] into negation normal form once; [`exact`]
//! gives its robustness at the samples of a trace, [`bound`] a guaranteed lower bound over the
//! continuous time of trajectories. Both walk the same [`Node`]s with the same window operators.

pub mod bound;
mod bound_past;
mod compile;
mod error;
pub mod exact;
mod node;
mod past;
mod predicate;
mod tree;
mod window;

pub use compile::{Names, compile};
pub use error::FormulaError;
pub use node::{Compiled, Node, Window};
pub use predicate::Predicate;
pub use tree::{Axis, Clause, Comparison, Formula, Term};
pub use window::Point;

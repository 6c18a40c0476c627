//! Why a formula cannot be compiled or evaluated.

use thiserror::Error;

/// Why a formula cannot be compiled or evaluated; the text names the value and what is legal.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FormulaError {
    /// A drone that the fleet does not have.
    #[error("unknown drone `{name}`; the fleet has {legal}")]
    UnknownDrone {
        /// The name.
        name: String,
        /// The names that exist.
        legal: String,
    },
    /// A region that the scenario does not have.
    #[error("unknown region `{name}`; there are {legal}")]
    UnknownRegion {
        /// The name.
        name: String,
        /// The names that exist.
        legal: String,
    },
    /// A name is given twice.
    #[error("the name `{0}` is given twice")]
    Duplicate(String),
    /// The sample period is not a positive number.
    #[error("the sample period is {0} s; legal is a finite number above 0")]
    Sample(f64),
    /// A window is not finite, not ordered, negative, or not on the sample grid.
    #[error(
        "window [{from}, {to}] s: legal is 0 <= from <= to, both finite multiples of the sample period {sample} s"
    )]
    Window {
        /// Its start [s].
        from: f64,
        /// Its end [s].
        to: f64,
        /// The sample period [s].
        sample: f64,
    },
    /// A conjunction, disjunction or sum without operands.
    #[error("`{0}` needs at least one operand")]
    Empty(&'static str),
    /// A constant or a position is NaN or infinite.
    #[error("{0} is not a finite number")]
    NotFinite(String),
    /// The formula looks beyond the end of the trace.
    #[error("the formula looks {needed} s ahead, beyond the end at {available} s")]
    Horizon {
        /// How far it looks [s].
        needed: f64,
        /// How far the trace reaches [s].
        available: f64,
    },
    /// The number of tracks is not the number of drones, or their lengths differ.
    #[error("{0}")]
    Tracks(String),
}

//! The formula tree that parser, planner, certificate, monitor and report share.

use serde::{Deserialize, Serialize};

/// A coordinate axis of the scenario frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    /// East.
    X,
    /// North.
    Y,
    /// Up.
    Z,
}

/// Which side of a threshold satisfies a distance predicate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Comparison {
    /// At least the threshold.
    Ge,
    /// At most the threshold.
    Le,
}

/// One summand of a linear predicate: `coef * drone.axis`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// Which drone.
    pub drone: String,
    /// Which coordinate of its position.
    pub axis: Axis,
    /// Factor, not normalised (design.md, Conventions).
    pub coef: f64,
}

/// An STL formula over the positions of the fleet. Windows are closed, in seconds from the time of
/// evaluation; quantifiers and named sets are expanded by the text parser.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "op", rename_all = "snake_case", deny_unknown_fields)]
pub enum Formula {
    /// `drone in region`; robustness is [`crate::geometry::Polyhedron::inside`].
    In {
        /// Drone id.
        drone: String,
        /// Region name.
        region: String,
    },
    /// `drone outside region`; robustness is [`crate::geometry::Polyhedron::outside`].
    Outside {
        /// Drone id.
        drone: String,
        /// Region name.
        region: String,
    },
    /// `dist(a, b) >= value` or `<= value`, Euclidean [m].
    Dist {
        /// First drone id.
        a: String,
        /// Second drone id.
        b: String,
        /// Direction.
        cmp: Comparison,
        /// Threshold [m].
        value: f64,
    },
    /// `sum of terms + constant >= 0`.
    Linear {
        /// Summands.
        terms: Vec<Term>,
        /// Constant.
        constant: f64,
    },
    /// Negation.
    Not {
        /// Operand.
        f: Box<Formula>,
    },
    /// Conjunction of one or more.
    And {
        /// Operands.
        fs: Vec<Formula>,
    },
    /// Disjunction of one or more.
    Or {
        /// Operands.
        fs: Vec<Formula>,
    },
    /// `left -> right`.
    Implies {
        /// Premise.
        left: Box<Formula>,
        /// Conclusion.
        right: Box<Formula>,
    },
    /// `always[from, to] f`.
    Always {
        /// Window start [s].
        from: f64,
        /// Window end [s].
        to: f64,
        /// Operand.
        f: Box<Formula>,
    },
    /// `eventually[from, to] f`.
    Eventually {
        /// Window start [s].
        from: f64,
        /// Window end [s].
        to: f64,
        /// Operand.
        f: Box<Formula>,
    },
    /// `left until[from, to] right`: `max over t' of min(right(t'), min over [t, t'] of left)`,
    /// left up to and including t' (paper Def. 1).
    Until {
        /// Window start [s].
        from: f64,
        /// Window end [s].
        to: f64,
        /// Must hold up to and including the switch.
        left: Box<Formula>,
        /// Must hold at the switch.
        right: Box<Formula>,
    },
    /// `once[from, to] f`: at some time of the window before now. The past begins at mission time 0: a
    /// window is cut there, and nothing was once in an empty one (robustness minus infinity).
    Once {
        /// Window end, back from now [s].
        from: f64,
        /// Window start, back from now [s].
        to: f64,
        /// Operand.
        f: Box<Formula>,
    },
    /// `historically[from, to] f`: all the time of the window before now; true of an empty one (infinity).
    Historically {
        /// Window end, back from now [s].
        from: f64,
        /// Window start, back from now [s].
        to: f64,
        /// Operand.
        f: Box<Formula>,
    },
    /// `left since[from, to] right`: `max over t' of min(right(t'), min over [t', t] of left)`, t' in the
    /// window before now; until turned round in time.
    Since {
        /// Window end, back from now [s].
        from: f64,
        /// Window start, back from now [s].
        to: f64,
        /// Must hold from t' on, at t' and now included.
        left: Box<Formula>,
        /// Must hold at t'.
        right: Box<Formula>,
    },
}

/// A named conjunct of the mission formula.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clause {
    /// Name, unique in the mission (`safe`, `apart`, `tr1`, ... or `c1`, `c2`, ...).
    pub id: String,
    /// Source text.
    pub text: String,
    /// Parsed tree, evaluated at mission time 0.
    pub formula: Formula,
}

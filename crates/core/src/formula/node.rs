//! The compiled formula: negation normal form over indices and sample counts.

use super::predicate::Predicate;

/// A closed window in samples from the time of evaluation, ahead or, of past operators, back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First sample.
    pub from: usize,
    /// Last sample, not before `from`.
    pub to: usize,
}

/// A node of the negation normal form: `not` and `implies` are gone, `until` and `since` have their duals.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A predicate over positions.
    Predicate(Predicate),
    /// Least of the operands.
    And(Vec<Node>),
    /// Greatest of the operands.
    Or(Vec<Node>),
    /// Least over the window.
    Always(Window, Box<Node>),
    /// Greatest over the window.
    Eventually(Window, Box<Node>),
    /// `max over t' in the window of min(right(t'), min over [t, t'] of left)`.
    Until {
        /// Where t' lies.
        window: Window,
        /// Holds up to and including t'.
        left: Box<Node>,
        /// Holds at t'.
        right: Box<Node>,
    },
    /// The dual of until: `min over t' in the window of max(right(t'), max over [t, t'] of left)`.
    Release {
        /// Where t' lies.
        window: Window,
        /// Releases `right` from the moment it holds.
        left: Box<Node>,
        /// Holds until released.
        right: Box<Node>,
    },
    /// Greatest over the window back, cut at sample 0; minus infinity over none.
    Once(Window, Box<Node>),
    /// Least over the window back, cut at sample 0; infinity over none.
    Historically(Window, Box<Node>),
    /// `max over t' in the window back of min(right(t'), min over [t', t] of left)`; minus infinity over none.
    Since {
        /// Where t' lies.
        window: Window,
        /// Holds from t' on.
        left: Box<Node>,
        /// Holds at t'.
        right: Box<Node>,
    },
    /// The dual of since: `min over t' in the window back of max(right(t'), max over [t', t] of left)`.
    Trigger {
        /// Where t' lies.
        window: Window,
        /// Makes up for `right` from then on.
        left: Box<Node>,
        /// Held, but for `left`.
        right: Box<Node>,
    },
}

impl Node {
    /// How many samples ahead the node looks.
    #[must_use]
    pub fn horizon(&self) -> usize {
        match self {
            Self::Predicate(_) => 0,
            Self::And(fs) | Self::Or(fs) => fs.iter().map(Self::horizon).max().unwrap_or(0),
            Self::Always(w, f) | Self::Eventually(w, f) => w.to.saturating_add(f.horizon()),
            Self::Until { window, left, right } | Self::Release { window, left, right } => {
                window.to.saturating_add(left.horizon().max(right.horizon()))
            }
            Self::Once(w, f) | Self::Historically(w, f) => f.horizon().saturating_sub(w.from),
            Self::Since { window, left, right } | Self::Trigger { window, left, right } => {
                left.horizon().max(right.horizon().saturating_sub(window.from))
            }
        }
    }
}

/// A formula that is ready to be evaluated for a fleet at a sample period.
#[derive(Clone, Debug, PartialEq)]
pub struct Compiled {
    /// Negation normal form.
    pub root: Node,
    /// Number of drones that the indices refer to.
    pub drones: usize,
    /// Sample period [s].
    pub sample: f64,
}

impl Compiled {
    /// How far the formula looks ahead [s].
    #[must_use]
    pub fn horizon(&self) -> f64 {
        self.root.horizon() as f64 * self.sample
    }
}

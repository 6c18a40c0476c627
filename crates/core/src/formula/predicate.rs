//! Predicates: their value at a point and a lower bound over a piece of curve.

use crate::geometry::Polyhedron;
use crate::types::Vec3;

/// One summand of [`Predicate::Linear`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearTerm {
    /// Index of the drone.
    pub drone: usize,
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Factor.
    pub coef: f64,
}

/// A predicate over the positions of the fleet, with indices instead of names. Robustness in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Predicate {
    /// [`Polyhedron::inside`].
    Inside {
        /// Index of the drone.
        drone: usize,
        /// Where it is to be.
        region: Polyhedron,
    },
    /// [`Polyhedron::outside`].
    Outside {
        /// Index of the drone.
        drone: usize,
        /// Where it is not to be.
        region: Polyhedron,
    },
    /// `|a - b| - value`.
    Apart {
        /// Index of one drone.
        a: usize,
        /// Index of the other drone.
        b: usize,
        /// Threshold [m].
        value: f64,
    },
    /// `value - |a - b|`.
    Near {
        /// Index of one drone.
        a: usize,
        /// Index of the other drone.
        b: usize,
        /// Threshold [m].
        value: f64,
    },
    /// `sum of coef * drone.axis + constant`.
    Linear {
        /// Summands, at least one.
        terms: Vec<LinearTerm>,
        /// Constant.
        constant: f64,
    },
}

impl Predicate {
    /// Robustness where `position` gives each drone's position [m].
    pub fn value(&self, position: impl Fn(usize) -> Vec3) -> f64 {
        match self {
            Self::Inside { drone, region } => region.inside(&position(*drone)),
            Self::Outside { drone, region } => region.outside(&position(*drone)),
            Self::Apart { a, b, value } => (position(*a) - position(*b)).norm() - value,
            Self::Near { a, b, value } => value - (position(*a) - position(*b)).norm(),
            Self::Linear { terms, constant } => {
                terms.iter().map(|t| t.coef * position(t.drone)[t.axis]).sum::<f64>() + constant
            }
        }
    }
}

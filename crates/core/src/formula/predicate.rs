//! Predicates: their value at a point and a lower bound over a piece of curve.

use crate::geometry::Polyhedron;
use crate::trajectory::Quintic;
use crate::trajectory::clearance::{
    max_pair_distance, min_inside, min_outside, min_pair_distance, min_value,
};
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

    /// Indices of the drones that it speaks of.
    #[must_use]
    pub fn drones(&self) -> Vec<usize> {
        match self {
            Self::Inside { drone, .. } | Self::Outside { drone, .. } => vec![*drone],
            Self::Apart { a, b, .. } | Self::Near { a, b, .. } => vec![*a, *b],
            Self::Linear { terms, .. } => terms.iter().map(|t| t.drone).collect(),
        }
    }

    /// Lower bound of the robustness while each drone runs along `curve` of it, all of one duration,
    /// within [`crate::trajectory::clearance::TOLERANCE`] (squared distances: of the square).
    pub fn lower_bound(&self, curve: impl Fn(usize) -> Quintic) -> f64 {
        let all = f64::INFINITY;
        match self {
            Self::Inside { drone, region } => min_inside(&curve(*drone), region, all),
            Self::Outside { drone, region } => min_outside(&curve(*drone), region, all),
            Self::Apart { a, b, value } => min_pair_distance(&curve(*a), &curve(*b), all) - value,
            Self::Near { a, b, value } => value - max_pair_distance(&curve(*a), &curve(*b)),
            Self::Linear { terms, constant } => {
                let mut coefficients = [*constant; 6];
                for term in terms {
                    for (sum, point) in coefficients.iter_mut().zip(curve(term.drone).points) {
                        *sum += term.coef * point[term.axis];
                    }
                }
                min_value(coefficients, all)
            }
        }
    }
}

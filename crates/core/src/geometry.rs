//! The one geometry: convex polyhedra and signed distances to them.

use crate::types::Vec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A half-space `a . x <= b` with `|a| = 1`; `b - a . x` is the distance inside [m].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// Outward unit normal.
    pub a: Vec3,
    /// Offset [m].
    pub b: f64,
}

/// Why a list of half-spaces is not a polyhedron.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum GeometryError {
    /// No half-space, or more than 256.
    #[error("a polyhedron has 1 to 256 faces, not {0}")]
    Count(usize),
    /// A row is zero or not finite.
    #[error("face {0} has a zero or non-finite normal or offset")]
    Face(usize),
}

/// A convex polyhedron {x : a_i . x <= b_i for all i}; rows are of unit length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<HalfSpace>", into = "Vec<HalfSpace>")]
pub struct Polyhedron {
    faces: Vec<HalfSpace>,
}

impl TryFrom<Vec<HalfSpace>> for Polyhedron {
    type Error = GeometryError;

    fn try_from(mut faces: Vec<HalfSpace>) -> Result<Self, GeometryError> {
        if faces.is_empty() || faces.len() > 256 {
            return Err(GeometryError::Count(faces.len()));
        }
        for (i, face) in faces.iter_mut().enumerate() {
            let norm = face.a.norm();
            if !norm.is_finite() || norm < 1e-12 || !face.b.is_finite() {
                return Err(GeometryError::Face(i));
            }
            // A row that is unit to rounding is kept bit for bit, so that decoding is stable.
            if (norm - 1.0).abs() > 1e-14 {
                face.a /= norm;
                face.b /= norm;
            }
        }
        Ok(Self { faces })
    }
}

impl From<Polyhedron> for Vec<HalfSpace> {
    fn from(polyhedron: Polyhedron) -> Self {
        polyhedron.faces
    }
}

impl Polyhedron {
    /// The axis-aligned box between two corners [m].
    ///
    /// # Errors
    /// When a coordinate is not finite.
    pub fn from_box(low: Vec3, high: Vec3) -> Result<Self, GeometryError> {
        let mut faces = Vec::with_capacity(6);
        for axis in 0..3 {
            let mut a = Vec3::zeros();
            a[axis] = 1.0;
            faces.push(HalfSpace { a, b: high[axis] });
            faces.push(HalfSpace { a: -a, b: -low[axis] });
        }
        Self::try_from(faces)
    }

    /// The faces, rows of unit length.
    #[must_use]
    pub fn faces(&self) -> &[HalfSpace] {
        &self.faces
    }

    /// Robustness of being inside: `min_i (b_i - a_i . x)` [m] (design.md, Conventions).
    #[must_use]
    pub fn inside(&self, x: &Vec3) -> f64 {
        self.faces.iter().map(|f| f.b - f.a.dot(x)).fold(f64::INFINITY, f64::min)
    }

    /// Robustness of being outside: `max_i (a_i . x - b_i)` [m]; never more than the Euclidean
    /// distance, so a positive value is a true clearance.
    #[must_use]
    pub fn outside(&self, x: &Vec3) -> f64 {
        -self.inside(x)
    }

    /// Index of the face that `x` is farthest beyond.
    #[must_use]
    pub fn farthest_face(&self, x: &Vec3) -> usize {
        let mut best = (0, f64::NEG_INFINITY);
        for (i, f) in self.faces.iter().enumerate() {
            let d = f.a.dot(x) - f.b;
            if d > best.1 {
                best = (i, d);
            }
        }
        best.0
    }
}

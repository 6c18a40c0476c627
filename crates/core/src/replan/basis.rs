//! A quintic segment as a linear function of its two knots.

/// Unit of time of the scaled knot variables (p, v TAU, a TAU^2) [s]: about one segment, so that all
/// three are of one size.
pub const TAU: f64 = 0.5;
/// Factors from (p, v, a) to the scaled knot variables.
pub const UNIT: [f64; 3] = [1.0, TAU, TAU * TAU];

/// Bernstein coefficients of position, velocity, acceleration and jerk of a segment, each a row over
/// the scaled knot values `(p0, v0, a0, p1, v1, a1)` of one axis.
#[derive(Clone, Copy, Debug)]
pub struct Basis {
    /// Duration [s].
    pub h: f64,
    /// Position [m], six coefficients.
    pub position: [[f64; 6]; 6],
    /// Velocity [m/s], five coefficients.
    pub velocity: [[f64; 6]; 5],
    /// Acceleration [m/s^2], four coefficients.
    pub acceleration: [[f64; 6]; 4],
    /// Jerk [m/s^3], three coefficients.
    pub jerk: [[f64; 6]; 3],
}

impl Basis {
    /// Basis of a segment of `h` seconds; the same map as [`crate::trajectory::Quintic::from_ends`].
    pub fn new(h: f64) -> Self {
        let (v, a) = (h / TAU, h * h / (TAU * TAU));
        let position = [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [1.0, v / 5.0, 0.0, 0.0, 0.0, 0.0],
            [1.0, 0.4 * v, a / 20.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, -0.4 * v, a / 20.0],
            [0.0, 0.0, 0.0, 1.0, -v / 5.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        ];
        let velocity = derivative(&position, 5.0 / h);
        let acceleration = derivative(&velocity, 4.0 / h);
        let jerk = derivative(&acceleration, 3.0 / h);
        Self { h, position, velocity, acceleration, jerk }
    }

    /// `Q` with `integral of jerk^2 = x' Q x` over the segment, x the six scaled knot values.
    pub fn jerk_cost(&self) -> [[f64; 6]; 6] {
        let mut q = [[0.0; 6]; 6];
        for (i, ji) in self.jerk.iter().enumerate() {
            for (k, jk) in self.jerk.iter().enumerate() {
                let w = self.h * GRAM[i][k];
                for r in 0..6 {
                    for c in 0..6 {
                        q[r][c] += w * ji[r] * jk[c];
                    }
                }
            }
        }
        q
    }
}

/// `integral over [0, 1] of B_i B_k` for the quadratic Bernstein polynomials:
/// `C(2,i) C(2,k) / (5 C(4,i+k))` (Farin, Curves and Surfaces for CAGD, section 6.10).
pub const GRAM: [[f64; 3]; 3] = [
    [1.0 / 5.0, 1.0 / 10.0, 1.0 / 30.0],
    [1.0 / 10.0, 2.0 / 15.0, 1.0 / 10.0],
    [1.0 / 30.0, 1.0 / 10.0, 1.0 / 5.0],
];

/// Bernstein coefficients of the derivative: `factor` times the differences of neighbours. Entries
/// that cancel (the knot's own position in its neighbour's velocity) are set to exactly zero, so
/// that a row names only the variables it depends on.
fn derivative<const N: usize, const M: usize>(c: &[[f64; 6]; N], factor: f64) -> [[f64; 6]; M] {
    let mut out = [[0.0; 6]; M];
    for i in 0..M {
        for (k, value) in out[i].iter_mut().enumerate() {
            let difference = c[i + 1][k] - c[i][k];
            let size = c[i + 1][k].abs().max(c[i][k].abs());
            *value = if difference.abs() <= 1e-12 * size { 0.0 } else { factor * difference };
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::Quintic;
    use crate::types::Vec3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_the_quintic(h in 0.1..0.6_f64, x in prop::array::uniform6(-3.0..3.0_f64)) {
            let lift = |v: f64| Vec3::new(v, 0.0, 0.0);
            let unit = [1.0, TAU, TAU * TAU, 1.0, TAU, TAU * TAU];
            let knot = |i: usize| lift(x[i] / unit[i]);
            let q = Quintic::from_ends(h, (knot(0), knot(1), knot(2)), (knot(3), knot(4), knot(5)));
            let basis = Basis::new(h);
            let dot = |row: &[f64; 6]| row.iter().zip(&x).map(|(a, b)| a * b).sum::<f64>();
            for (row, p) in basis.position.iter().zip(q.points) {
                prop_assert!((dot(row) - p.x).abs() < 1e-9);
            }
            for (row, j) in basis.jerk.iter().zip(q.jerk_points()) {
                prop_assert!((dot(row) - j.x).abs() < 1e-6 * (1.0 + j.x.abs()));
            }
            // Simpson's rule is exact for the square of a quadratic only with enough panels.
            let n = 200;
            let simpson: f64 = (0..=n)
                .map(|k| {
                    let w = if k == 0 || k == n { 1.0 } else if k % 2 == 1 { 4.0 } else { 2.0 };
                    w * q.jerk(f64::from(k) / f64::from(n)).x.powi(2)
                })
                .sum::<f64>() * h / (3.0 * f64::from(n));
            let cost = basis.jerk_cost();
            let form: f64 = (0..6).map(|r| x[r] * dot(&cost[r])).sum();
            prop_assert!((form - simpson).abs() < 1e-6 * (1.0 + simpson));
        }
    }
}

//! The quadratic program of one rejoin candidate, solved by Clarabel over the rows that matter.
//!
//! Minimise the integral of jerk^2 plus [`DEVIATION_WEIGHT`] times that of the squared deviation from
//! the fleet plan. Of some thousand rows few are ever active, so only those near the free optimum
//! are posed; rows that the result violates are added and it is solved again. Fewer rows are a
//! relaxation: an infeasible subset proves the whole infeasible, and a solution that keeps every row
//! is optimal for all.

use super::basis::Basis;
use super::rows::Rows;
use super::states::States;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus,
    SupportedConeT::NonnegativeConeT,
};
use nalgebra::{DMatrix, DVector};

/// Weight of the squared deviation from the plan against squared jerk [1/s^6]: the free optimum
/// comes back with about `DEVIATION_WEIGHT^(1/6)` = 0.9 rad/s.
pub const DEVIATION_WEIGHT: f64 = 0.5;
/// Price of leaving a soft corridor [objective per metre and segment]; far above the multipliers
/// that a replan within the acceleration limit has, so slack is used only where it must be.
const SLACK_PRICE: f64 = 1e4;
/// Interior-point steps; solved instances need 6 to 20, and the rest must not hold up the drone.
const MAX_ITERATIONS: u32 = 50;
/// Solves with more and more rows before every row is posed.
const PARTIAL_ROUNDS: u32 = 6;
/// Violation at which a row that was not posed is added; below the margin of the rows.
const VIOLATED: f64 = 5e-7;

/// Why a program gave no trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum QpError {
    /// No trajectory keeps all bounds.
    #[error("no trajectory keeps the limits and corridors")]
    Infeasible,
    /// The solver stopped without a solution.
    #[error("the solver stopped with {0:?}")]
    Unsolved(SolverStatus),
    /// The problem could not be set up.
    #[error("the problem could not be set up")]
    Setup,
}

/// Deviations of the free knots from their base at the optimum (see [`States`]).
pub fn solve(states: &States, bases: &[Basis], rows: &Rows) -> Result<Vec<f64>, QpError> {
    let cost = Cost::new(states, bases);
    let mut x = cost.free_minimum().ok_or(QpError::Setup)?;
    let mut posed = vec![false; rows.len()];
    for round in 0_u32.. {
        let everything = round == PARTIAL_ROUNDS;
        let violated = (0..rows.len()).any(|i| !posed[i] && rows.excess(i, &x) > VIOLATED);
        if !violated {
            break;
        }
        for (i, posed) in posed.iter_mut().enumerate() {
            *posed |= everything || rows.is_near(i, &x, f64::from(1 + 2 * round));
        }
        x = constrained(&cost, rows, &posed)?;
        if everything {
            break;
        }
    }
    Ok(x)
}

/// `x' P x / 2 + q' x` with the same P for each axis.
struct Cost {
    /// One axis, dense; banded with 5 diagonals above the main one.
    p: DMatrix<f64>,
    /// All axes.
    q: Vec<f64>,
}

impl Cost {
    fn new(states: &States, bases: &[Basis]) -> Self {
        let n = states.per_axis();
        let mut p = DMatrix::zeros(n, n);
        let mut q = vec![0.0; 3 * n];
        for (k, basis) in bases.iter().enumerate() {
            let form = basis.jerk_cost();
            for (r, row) in states.columns(k, 0).enumerate() {
                let Some(row) = row else { continue };
                for (c, column) in states.columns(k, 0).enumerate() {
                    if let Some(column) = column {
                        p[(row, column)] += 2.0 * form[r][c];
                    }
                }
                for axis in 0..3 {
                    q[axis * n + row] += 2.0 * states.base_value(k, axis, &form[r]);
                }
            }
        }
        for knot in 1..states.times.len() - 1 {
            let share = 0.5 * (states.times[knot + 1] - states.times[knot - 1]);
            if let Some(i) = states.column(knot, 0, 0) {
                p[(i, i)] += 2.0 * DEVIATION_WEIGHT * share;
            }
        }
        Self { p, q }
    }

    /// The minimiser without any row, in closed form.
    fn free_minimum(&self) -> Option<Vec<f64>> {
        let factor = self.p.clone().cholesky()?;
        let n = self.p.nrows();
        let mut x = Vec::with_capacity(3 * n);
        for axis in 0..3 {
            let q = DVector::from_column_slice(&self.q[axis * n..(axis + 1) * n]);
            x.extend(factor.solve(&(-q)).iter());
        }
        Some(x)
    }

    /// Upper triangle of the joint P, with empty columns for the slack variables.
    fn joint(&self, slacks: usize) -> CscMatrix<f64> {
        let n = self.p.nrows();
        let size = 3 * n + slacks;
        let (mut starts, mut rows, mut values) = (Vec::with_capacity(size + 1), Vec::new(), Vec::new());
        for axis in 0..3 {
            for c in 0..n {
                starts.push(rows.len());
                for r in c.saturating_sub(5)..=c {
                    if self.p[(r, c)] != 0.0 {
                        rows.push(axis * n + r);
                        values.push(self.p[(r, c)]);
                    }
                }
            }
        }
        starts.resize(size + 1, rows.len());
        CscMatrix::new(size, size, starts, rows, values)
    }
}

/// One Clarabel solve over the posed rows; only `Solved` counts.
fn constrained(cost: &Cost, rows: &Rows, posed: &[bool]) -> Result<Vec<f64>, QpError> {
    let variables = cost.q.len();
    let slacks = rows.slacks();
    let (mut r, mut c, mut v, mut b) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for i in (0..rows.len()).filter(|i| posed[*i]) {
        let slack = rows.slack(i).map(|s| (variables + s, -1.0));
        for (column, value) in rows.row(i).chain(slack) {
            r.push(b.len());
            c.push(column);
            v.push(value);
        }
        b.push(rows.upper(i));
    }
    for s in 0..slacks {
        r.push(b.len());
        c.push(variables + s);
        v.push(-1.0);
        b.push(0.0);
    }
    let a = CscMatrix::new_from_triplets(b.len(), variables + slacks, r, c, v);
    let mut q = cost.q.clone();
    q.resize(variables + slacks, SLACK_PRICE);
    let cones = [NonnegativeConeT(b.len())];
    let mut solver = DefaultSolver::new(&cost.joint(slacks), &q, &a, &b, &cones, settings()?)
        .map_err(|_| QpError::Setup)?;
    solver.solve();
    match solver.solution.status {
        SolverStatus::Solved => Ok(solver.solution.x[..variables].to_vec()),
        SolverStatus::PrimalInfeasible => Err(QpError::Infeasible),
        status => Err(QpError::Unsolved(status)),
    }
}

/// One thread and a limit in iterations, not in time: the same bytes on every run.
fn settings() -> Result<DefaultSettings<f64>, QpError> {
    DefaultSettingsBuilder::default()
        .verbose(false)
        .presolve_enable(false)
        .max_threads(1)
        .max_iter(MAX_ITERATIONS)
        .build()
        .map_err(|_| QpError::Setup)
}

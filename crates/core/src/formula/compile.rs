//! From the tree with names and seconds to the negation normal form with indices and samples.

use super::error::FormulaError;
use super::node::{Compiled, Node, Window};
use super::predicate::{LinearTerm, Predicate};
use super::tree::{Axis, Comparison, Formula, Term};
use crate::wire::Region;
use std::collections::BTreeSet;

/// Largest distance of a window end from the sample grid, in samples: rounding of a decimal number.
const GRID_TOLERANCE: f64 = 1e-6;
/// Longest window in samples; keeps sums of windows far from overflow.
const MAX_SAMPLES: f64 = 1e9;

/// The drones and regions that a formula may name.
#[derive(Clone, Debug, PartialEq)]
pub struct Names {
    drones: Vec<String>,
    regions: Vec<Region>,
}

impl Names {
    /// The drones in the order of the tracks, and the regions.
    ///
    /// # Errors
    /// When a name is given twice.
    pub fn new(drones: Vec<String>, regions: Vec<Region>) -> Result<Self, FormulaError> {
        for names in [drones.iter().collect::<Vec<_>>(), regions.iter().map(|r| &r.name).collect()] {
            let mut seen = BTreeSet::new();
            if let Some(twice) = names.into_iter().find(|name| !seen.insert(*name)) {
                return Err(FormulaError::Duplicate(twice.clone()));
            }
        }
        Ok(Self { drones, regions })
    }

    /// Drone ids in the order of the tracks.
    #[must_use]
    pub fn drones(&self) -> &[String] {
        &self.drones
    }

    fn drone(&self, name: &str) -> Result<usize, FormulaError> {
        self.drones.iter().position(|d| d == name).ok_or_else(|| FormulaError::UnknownDrone {
            name: name.to_owned(),
            legal: self.drones.join(", "),
        })
    }

    fn region(&self, name: &str) -> Result<&Region, FormulaError> {
        self.regions.iter().find(|r| r.name == name).ok_or_else(|| FormulaError::UnknownRegion {
            name: name.to_owned(),
            legal: self.regions.iter().map(|r| r.name.as_str()).collect::<Vec<_>>().join(", "),
        })
    }
}

/// Resolves names, checks windows and constants, and pushes every negation down to the predicates.
///
/// # Errors
/// See [`FormulaError`]; whether the horizon fits is checked against the trace when it is evaluated.
pub fn compile(formula: &Formula, names: &Names, sample: f64) -> Result<Compiled, FormulaError> {
    if !(sample.is_finite() && sample > 0.0) {
        return Err(FormulaError::Sample(sample));
    }
    let root = Compiler { names, sample }.node(formula, true)?;
    Ok(Compiled { root, drones: names.drones.len(), sample })
}

struct Compiler<'a> {
    names: &'a Names,
    sample: f64,
}

impl Compiler<'_> {
    /// The normal form of `formula` (`positive`) or of its negation.
    fn node(&self, formula: &Formula, positive: bool) -> Result<Node, FormulaError> {
        match formula {
            Formula::In { drone, region } => self.region(drone, region, positive),
            Formula::Outside { drone, region } => self.region(drone, region, !positive),
            Formula::Dist { a, b, cmp, value } => {
                self.dist(a, b, (*cmp == Comparison::Ge) == positive, *value)
            }
            Formula::Linear { terms, constant } => self.linear(terms, *constant, positive),
            Formula::Not { f } => self.node(f, !positive),
            Formula::And { fs } => self.junction("and", fs, positive, positive),
            Formula::Or { fs } => self.junction("or", fs, !positive, positive),
            Formula::Implies { left, right } => {
                let operands = vec![self.node(left, !positive)?, self.node(right, positive)?];
                Ok(if positive { Node::Or(operands) } else { Node::And(operands) })
            }
            Formula::Always { from, to, f } => self.window_node(*from, *to, f, positive, positive),
            Formula::Eventually { from, to, f } => self.window_node(*from, *to, f, !positive, positive),
            Formula::Until { from, to, left, right } => {
                let window = self.window(*from, *to)?;
                let left = Box::new(self.node(left, positive)?);
                let right = Box::new(self.node(right, positive)?);
                Ok(if positive {
                    Node::Until { window, left, right }
                } else {
                    Node::Release { window, left, right }
                })
            }
            Formula::Once { from, to, f } => self.past_node(*from, *to, f, !positive, positive),
            Formula::Historically { from, to, f } => self.past_node(*from, *to, f, positive, positive),
            Formula::Since { from, to, left, right } => {
                let window = self.window(*from, *to)?;
                let left = Box::new(self.node(left, positive)?);
                let right = Box::new(self.node(right, positive)?);
                Ok(if positive {
                    Node::Since { window, left, right }
                } else {
                    Node::Trigger { window, left, right }
                })
            }
        }
    }

    fn region(&self, drone: &str, region: &str, inside: bool) -> Result<Node, FormulaError> {
        let drone = self.names.drone(drone)?;
        let region = self.names.region(region)?.shape.clone();
        let predicate =
            if inside { Predicate::Inside { drone, region } } else { Predicate::Outside { drone, region } };
        Ok(Node::Predicate(predicate))
    }

    fn dist(&self, a: &str, b: &str, apart: bool, value: f64) -> Result<Node, FormulaError> {
        let (a, b) = (self.names.drone(a)?, self.names.drone(b)?);
        finite("the threshold of dist", value)?;
        Ok(Node::Predicate(if apart {
            Predicate::Apart { a, b, value }
        } else {
            Predicate::Near { a, b, value }
        }))
    }

    fn linear(&self, terms: &[Term], constant: f64, positive: bool) -> Result<Node, FormulaError> {
        if terms.is_empty() {
            return Err(FormulaError::Empty("linear"));
        }
        finite("the constant of a linear predicate", constant)?;
        let sign = if positive { 1.0 } else { -1.0 };
        let terms = terms
            .iter()
            .map(|term| {
                finite("a coefficient of a linear predicate", term.coef)?;
                let axis = match term.axis {
                    Axis::X => 0,
                    Axis::Y => 1,
                    Axis::Z => 2,
                };
                Ok(LinearTerm { drone: self.names.drone(&term.drone)?, axis, coef: sign * term.coef })
            })
            .collect::<Result<_, _>>()?;
        Ok(Node::Predicate(Predicate::Linear { terms, constant: sign * constant }))
    }

    fn junction(
        &self,
        op: &'static str,
        fs: &[Formula],
        conjunction: bool,
        positive: bool,
    ) -> Result<Node, FormulaError> {
        if fs.is_empty() {
            return Err(FormulaError::Empty(op));
        }
        let operands = fs.iter().map(|f| self.node(f, positive)).collect::<Result<_, _>>()?;
        Ok(if conjunction { Node::And(operands) } else { Node::Or(operands) })
    }

    fn window_node(
        &self,
        from: f64,
        to: f64,
        f: &Formula,
        always: bool,
        positive: bool,
    ) -> Result<Node, FormulaError> {
        let window = self.window(from, to)?;
        let f = Box::new(self.node(f, positive)?);
        Ok(if always { Node::Always(window, f) } else { Node::Eventually(window, f) })
    }

    fn past_node(
        &self,
        from: f64,
        to: f64,
        f: &Formula,
        historically: bool,
        positive: bool,
    ) -> Result<Node, FormulaError> {
        let window = self.window(from, to)?;
        let f = Box::new(self.node(f, positive)?);
        Ok(if historically { Node::Historically(window, f) } else { Node::Once(window, f) })
    }

    fn window(&self, from: f64, to: f64) -> Result<Window, FormulaError> {
        let samples = |seconds: f64| {
            let count = seconds / self.sample;
            let on_grid = (count - count.round()).abs() <= GRID_TOLERANCE;
            (on_grid && (0.0..=MAX_SAMPLES).contains(&count.round())).then(|| count.round() as usize)
        };
        match (samples(from), samples(to)) {
            (Some(first), Some(last)) if first <= last => Ok(Window { from: first, to: last }),
            _ => Err(FormulaError::Window { from, to, sample: self.sample }),
        }
    }
}

fn finite(what: &str, value: f64) -> Result<(), FormulaError> {
    if value.is_finite() { Ok(()) } else { Err(FormulaError::NotFinite(what.to_owned())) }
}

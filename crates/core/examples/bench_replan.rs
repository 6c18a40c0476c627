//! `make bench-replan`: thread CPU time and wall time of local replans over seeded random instances.
// A benchmark owns a clock, prints its table, writes its file and may stop at the first surprise.
#![allow(clippy::disallowed_methods, clippy::print_stdout, clippy::unwrap_used, clippy::panic)]

#[path = "../tests/fixture/mod.rs"]
mod fixture;
#[path = "../tests/fixture/instance.rs"]
mod instance;

use cpu_time::ThreadTime;
use fleet_core::admission::{VehicleLimits, admit};
use fleet_core::replan::Replanner;
use fleet_core::trajectory::{MAX_SEGMENTS, Trajectory};
use fleet_core::wire::{Plan, ReplanOutcome};
use instance::{GUST, Push, STORM};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::process::Command;
use std::time::Instant;

const SEED: u64 = 1;
const INSTANCES: u64 = 1000;

/// Times of one case [us] and how its calls ended.
struct Row {
    case: &'static str,
    cpu: Vec<f64>,
    wall: Vec<f64>,
    solved: usize,
}

impl Row {
    fn new(case: &'static str) -> Self {
        Self { case, cpu: Vec::new(), wall: Vec::new(), solved: 0 }
    }

    /// Runs `call`, which says whether it solved.
    fn time(&mut self, call: impl FnOnce() -> bool) {
        let (cpu, wall) = (ThreadTime::now(), Instant::now());
        self.solved += usize::from(call());
        self.wall.push(wall.elapsed().as_secs_f64() * 1e6);
        self.cpu.push(cpu.elapsed().as_secs_f64() * 1e6);
    }

    fn json(mut self) -> Value {
        let n = self.cpu.len();
        json!({
            "case": self.case, "n": n, "solved": self.solved, "refused": n - self.solved,
            "cpu_us": quantiles(&mut self.cpu), "wall_us": quantiles(&mut self.wall),
        })
    }
}

fn quantiles(values: &mut [f64]) -> Value {
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values[((q * values.len() as f64).ceil() as usize).clamp(1, values.len()) - 1];
    let tenth = |x: f64| (x * 10.0).round() / 10.0;
    json!({ "p50": tenth(at(0.5)), "p99": tenth(at(0.99)), "p999": tenth(at(0.999)), "max": tenth(at(1.0)) })
}

/// `candidates` waypoints are tried per instance.
fn replans(case: &'static str, plans: &[Plan], push: Push, candidates: usize) -> Row {
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut replanners = BTreeMap::new();
    let mut row = Row::new(case);
    for id in 0..INSTANCES {
        let plan = &plans[id as usize % plans.len()];
        let (drone, mut request) = instance::draw(&mut rng, plan, push, id);
        request.rejoin.truncate(candidates);
        let key = (plan.scenario.clone(), drone.clone());
        let replanner = replanners.entry(key).or_insert_with(|| Replanner::new(plan, &drone).unwrap());
        row.time(|| replanner.solve(&request).outcome == ReplanOutcome::Committed);
    }
    row
}

/// The plans with limits just above what their own trajectories need: rows are active nearly always.
fn tight() -> [Plan; 2] {
    instance::plans().map(|mut plan| {
        let peaks: Vec<_> = plan.drones.iter().map(|d| d.trajectory.bounds()).collect();
        plan.limits.v_max = 1.05 * peaks.iter().map(|(v, _)| v.max()).fold(0.0, f64::max);
        plan.limits.a_max = 1.05 * peaks.iter().map(|(_, a)| a.max()).fold(0.0, f64::max);
        plan
    })
}

/// Preparing the corridors of a plan, once per commit.
fn preparation() -> Row {
    let mut row = Row::new("prepare corridors");
    for plan in instance::plans() {
        for _ in 0..20 {
            row.time(|| Replanner::new(&plan, "d1").is_ok());
        }
    }
    row
}

/// The crossing plan cut into the most segments that are legal.
fn longest() -> Plan {
    let mut plan = fixture::crossing();
    for d in &mut plan.drones {
        let old = &d.trajectory;
        let step = old.end() / MAX_SEGMENTS as f64;
        let mut times: Vec<f64> = old.knots().iter().map(|k| k.t).collect();
        times.extend((0..=MAX_SEGMENTS).map(|k| k as f64 * step));
        times.sort_by(f64::total_cmp);
        times.dedup_by(|b, a| *b - *a < 0.05);
        *times.last_mut().unwrap() = old.end();
        let knots = times.iter().map(|t| {
            let ((p, v, a), r) = (old.motion(*t), old.sample(*t));
            let i = old.segment_at(*t);
            let s = (t - old.knots()[i].t) / (old.knots()[i + 1].t - old.knots()[i].t);
            let psi_acc = old.heading_quintic(i).acceleration(s.min(1.0)).x;
            fleet_core::trajectory::Knot { t: *t, p, v, a, psi: r.psi, psi_rate: r.psi_rate, psi_acc }
        });
        d.trajectory = Trajectory::try_from(knots.collect::<Vec<_>>()).unwrap();
    }
    plan
}

fn admission() -> Row {
    let vehicle = VehicleLimits { v_max: 5.0, a_max: 4.0, psi_rate_max: 0.8 };
    let plan = longest();
    let mut row = Row::new("admit longest plan");
    for _ in 0..50 {
        row.time(|| match admit(&plan, "d1", "fleet", &vehicle) {
            Ok(()) => true,
            Err((code, reason)) => panic!("{code:?}: {reason}"),
        });
    }
    row
}

fn main() {
    let plans = instance::plans();
    let rows = [
        replans("gust, next waypoint", &plans, GUST, 1),
        replans("gust, three waypoints", &plans, GUST, 3),
        replans("gust, tight limits", &tight(), GUST, 3),
        replans("storm, three waypoints", &plans, STORM, 3),
        preparation(),
        admission(),
    ]
    .map(Row::json);
    println!("seed {SEED}; times in microseconds");
    println!(
        "{:24} {:>5} {:>6} {:>7}  {:>32}  {:>32}",
        "case", "n", "solved", "refused", "CPU p50 / p99 / p99.9 / max", "wall p50 / p99 / p99.9 / max"
    );
    for r in &rows {
        let four =
            |v: &Value| ["p50", "p99", "p999", "max"].map(|q| format!("{:.0}", v[q].as_f64().unwrap()));
        let (case, cpu, wall) = (r["case"].as_str().unwrap(), four(&r["cpu_us"]), four(&r["wall_us"]));
        println!(
            "{case:24} {:>5} {:>6} {:>7}  {:>32}  {:>32}",
            r["n"],
            r["solved"],
            r["refused"],
            cpu.join(" / "),
            wall.join(" / ")
        );
    }
    let report = json!({ "schema": 1, "git": git(), "machine": machine(), "seed": SEED, "rows": rows });
    std::fs::create_dir_all("target/bench").unwrap();
    std::fs::write("target/bench/replan.json", format!("{report:#}\n")).unwrap();
}

fn git() -> String {
    let out = Command::new("git").args(["describe", "--always", "--dirty"]).output();
    out.map(|o| String::from_utf8_lossy(&o.stdout).trim().to_owned()).unwrap_or_default()
}

/// The machine, in the shape of the other benchmarks.
fn machine() -> Value {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let info = read("/proc/cpuinfo");
    let model = info.lines().find_map(|l| l.strip_prefix("model name")).unwrap_or("unknown");
    let load: Option<f64> = read("/proc/loadavg").split(' ').next().and_then(|x| x.parse().ok());
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    json!({ "cpu": model.trim_start_matches([' ', '\t', ':']), "cores": cores, "load": load })
}

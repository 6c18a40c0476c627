//! `make bench-tick`: thread CPU time and wall time of one agent step over 100,000 ticks of tracking.
// A benchmark owns a clock, prints its table, writes its file and may stop at the first surprise.
#![allow(clippy::disallowed_methods, clippy::print_stdout, clippy::unwrap_used, clippy::panic)]

use cpu_time::ThreadTime;
use fleet_agent::io::{Input, Output, VehicleCmd, VehicleMode, VehicleMsg, VehicleRequest};
use fleet_agent::{Agent, AgentConfig};
use fleet_core::formula::Formula;
use fleet_core::geometry::Polyhedron;
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::{Limits, Nanos, Quat, ReplanParams, Vec3};
use fleet_core::wire::{
    ClauseResult, Command, Commit, Down, DronePlan, Envelope, Mode, Offer, Pad, Plan, PlanStatus,
    PlannedClause, Region, SCHEMA, Up, Visit, encode, plan_hash,
};
use serde_json::{Value, json};
use std::process::Command as Process;
use std::time::Instant;

const TICKS: usize = 100_000;
const PERIOD: u64 = 10_000_000;
/// Seconds flown before measuring; the mission is long enough for all ticks.
const HORIZON: f64 = TICKS as f64 * 0.01 + 60.0;
const PAD: Vec3 = Vec3::new(0.0, 0.0, 0.1);
const HOME: Vec3 = Vec3::new(0.0, 0.0, 1.1);

/// A vehicle that is always exactly where the reference is, so that every tick is a tracking tick.
struct Ride {
    agent: Agent,
    now: Nanos,
    inbox: Vec<Input>,
    seq: u64,
    mode: Mode,
    armed: bool,
    vehicle_mode: VehicleMode,
    at: (Vec3, Vec3),
}

fn main() {
    let mut ride = Ride {
        agent: Agent::new(AgentConfig::new("fleet", "d1")),
        now: Nanos(1_000_000_000),
        inbox: Vec::new(),
        seq: 0,
        mode: Mode::Idle,
        armed: false,
        vehicle_mode: VehicleMode::Loiter,
        at: (PAD, Vec3::zeros()),
    };
    ride.prepare();
    let (mut cpu, mut wall, mut setpoints) = (Vec::new(), Vec::new(), 0);
    for _ in 0..TICKS {
        let inbox = ride.sense();
        let (c, w) = (ThreadTime::now(), Instant::now());
        let out = ride.agent.step(ride.now, &inbox);
        let (w, c) = (w.elapsed(), c.elapsed());
        cpu.push(c.as_secs_f64() * 1e6);
        wall.push(w.as_secs_f64() * 1e6);
        setpoints += out.iter().filter(|o| matches!(o, Output::Vehicle(VehicleCmd::Rates(_)))).count();
        ride.carry(out);
    }
    assert_eq!((setpoints, ride.mode), (TICKS, Mode::Track), "every tick must track");
    report(cpu, wall);
}

fn report(mut cpu: Vec<f64>, mut wall: Vec<f64>) {
    let n = cpu.len();
    let row = json!({
        "case": "track", "n": n, "solved": n, "refused": 0,
        "cpu_us": quantiles(&mut cpu), "wall_us": quantiles(&mut wall),
    });
    println!("{:<8} {:>8} {:>8} {:>8} {:>8} {:>8}", "case", "n", "p50", "p99", "p99.9", "max us");
    for (name, key) in [("cpu", "cpu_us"), ("wall", "wall_us")] {
        let q = &row[key];
        println!("{name:<8} {n:>8} {:>8} {:>8} {:>8} {:>8}", q["p50"], q["p99"], q["p999"], q["max"]);
    }
    let git = shell("git", &["rev-parse", "--short", "HEAD"]);
    let machine = format!("{}, {} cores", shell("uname", &["-sm"]), shell("nproc", &[]));
    let file = json!({ "schema": 1, "git": git, "machine": machine, "rows": [row] });
    std::fs::create_dir_all("target/bench").unwrap();
    std::fs::write("target/bench/tick.json", format!("{file:#}\n")).unwrap();
}

fn quantiles(values: &mut [f64]) -> Value {
    values.sort_by(f64::total_cmp);
    let at = |q: f64| values[((q * values.len() as f64).ceil() as usize).clamp(1, values.len()) - 1];
    let hundredth = |x: f64| (x * 100.0).round() / 100.0;
    json!({ "p50": hundredth(at(0.5)), "p99": hundredth(at(0.99)), "p999": hundredth(at(0.999)), "max": hundredth(at(1.0)) })
}

fn shell(program: &str, arguments: &[&str]) -> String {
    let output = Process::new(program).args(arguments).output();
    output.map_or_else(|_| "unknown".into(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

impl Ride {
    /// Commits a plan, arms, starts, and rides up to the first second of tracking.
    fn prepare(&mut self) {
        for _ in 0..250 {
            self.tick();
        }
        let bytes = encode(&plan()).unwrap();
        let hash = plan_hash(&bytes);
        self.ask(Down::Offer(Offer { hash: hash.clone(), plan: bytes }));
        self.ask(Down::Commit(Commit { hash: hash.clone() }));
        self.ask(Down::Command(Command::Arm));
        for _ in 0..150 {
            self.tick();
        }
        let t0 = self.now.plus(11.0);
        self.ask(Down::Command(Command::Start { t0, hash }));
        for _ in 0..1300 {
            self.tick();
        }
        assert_eq!(self.mode, Mode::Track, "not tracking");
    }

    fn ask(&mut self, body: Down) {
        self.seq += 1;
        let envelope = Envelope {
            schema: SCHEMA,
            mission_id: "0".repeat(32),
            epoch: 1,
            seq: self.seq,
            issued: self.now,
            valid_until: self.now.plus(5.0),
            body,
        };
        self.inbox.push(Input::Ground { bytes: encode(&envelope).unwrap() });
        self.tick();
        self.tick();
    }

    fn tick(&mut self) {
        let inbox = self.sense();
        let out = self.agent.step(self.now, &inbox);
        self.carry(out);
    }

    /// What a real link brings in 10 ms.
    fn sense(&mut self) -> Vec<Input> {
        self.now = Nanos(self.now.0 + PERIOD);
        let boot_ms = (self.now.0 / 1_000_000) as u32;
        let mut messages = vec![
            VehicleMsg::Attitude { boot_ms, q: Quat::identity(), w: Vec3::zeros() },
            VehicleMsg::LocalPosition { boot_ms, p: self.at.0 - PAD, v: self.at.1 },
        ];
        if self.now.0.is_multiple_of(2 * PERIOD) {
            messages.push(VehicleMsg::Odometry { reset_counter: 0 });
        }
        if self.now.0.is_multiple_of(20 * PERIOD) {
            messages.push(VehicleMsg::Battery { remaining: None, voltage: None, prearm_ok: true });
            let (armed, mode) = (self.armed, self.vehicle_mode);
            messages.push(VehicleMsg::Heartbeat { armed, mode, system_status: 4 });
        }
        let mut inbox = std::mem::take(&mut self.inbox);
        inbox.extend(messages.into_iter().map(Input::Vehicle));
        inbox
    }

    fn carry(&mut self, out: Vec<Output>) {
        let accepted = |request| Input::Vehicle(VehicleMsg::Ack { request: Some(request), result: 0 });
        for output in out {
            match output {
                Output::Vehicle(VehicleCmd::SetMode { mode }) => {
                    self.vehicle_mode = mode;
                    self.inbox.push(accepted(VehicleRequest::Mode));
                }
                Output::Vehicle(VehicleCmd::Arm { arm, .. }) => {
                    self.armed = arm;
                    self.inbox.push(accepted(VehicleRequest::Arm));
                }
                Output::Vehicle(VehicleCmd::ReadParam { name }) => {
                    let value = if name == "COM_OF_LOSS_T" { 0.5 } else { 5.0 };
                    self.inbox.push(Input::Vehicle(VehicleMsg::Param { name, value }));
                }
                Output::Persist { id, .. } => self.inbox.push(Input::Persisted { id, ok: true }),
                Output::Tick(tick) => {
                    self.mode = tick.mode;
                    if let Some(r) = tick.reference {
                        self.at = (r.p, r.v);
                    }
                }
                Output::Publish { message, .. } => {
                    if let Up::Ack(ack) = *message {
                        assert!(format!("{:?}", ack.outcome).contains("Accepted"), "{ack:?}");
                    }
                }
                Output::Vehicle(_) | Output::Solve(_) | Output::Status(_) => {}
            }
        }
    }
}

/// One drone that flies to and fro, five seconds a segment.
fn plan() -> Plan {
    let count = (HORIZON / 5.0).round() as usize;
    let knots = (0..=count).map(|k| Knot {
        t: 5.0 * k as f64,
        p: HOME + if k % 2 == 1 { Vec3::new(3.0, 1.0, 2.0) } else { Vec3::zeros() },
        v: Vec3::zeros(),
        a: Vec3::zeros(),
        psi: 0.0,
        psi_rate: 0.0,
        psi_acc: 0.0,
    });
    let cube = |half: f64| {
        let r = Vec3::new(half, half, half);
        Polyhedron::from_box(HOME - r, HOME + r).unwrap()
    };
    let horizon = 5.0 * count as f64;
    let stay = Formula::In { drone: "d1".into(), region: "workspace".into() };
    Plan {
        schema: SCHEMA,
        scenario: "bench".into(),
        fleet: "fleet".into(),
        seed: 1,
        horizon,
        sample: 0.05,
        limits: Limits { v_max: 3.0, a_max: 3.0, psi_rate_max: 0.5, delta_min: 3.0, tube: 0.4 },
        replan: ReplanParams { t_e: 0.1, t_g: 5.0, eta: 0.4, enabled: true },
        regions: vec![
            Region { name: "workspace".into(), shape: cube(30.0) },
            Region { name: "home".into(), shape: cube(1.0) },
        ],
        workspace: "workspace".into(),
        obstacles: Vec::new(),
        clauses: vec![PlannedClause {
            id: "safe".into(),
            text: "always[0,T] d1 in workspace".into(),
            kind: "invariant".into(),
            drones: vec!["d1".into()],
            weight: 1.0,
            priority: 0,
            formula: Formula::Always { from: 0.0, to: horizon, f: Box::new(stay) },
            result: ClauseResult { rho: 5.0, rho_lower: 5.0, t_tightest: 0.0 },
        }],
        method: "by hand".into(),
        status: PlanStatus::Certified,
        rho: 5.0,
        rho_lower: 5.0,
        rho_bound: 5.0,
        drones: vec![DronePlan {
            id: "d1".into(),
            pad: Pad { p: PAD, psi: 0.0 },
            home: "home".into(),
            trajectory: Trajectory::try_from(knots.collect::<Vec<_>>()).unwrap(),
            visits: Vec::<Visit>::new(),
            topics: (1..count).map(|k| 5.0 * k as f64).collect(),
        }],
    }
}

//! What the agent tells the others: heartbeat, telemetry, events, answers, status.

use super::Agent;
use super::mission::Asked;
use crate::io::{Output, Tick};
use fleet_core::types::Nanos;
use fleet_core::wire::{
    Ack, AckResult, Envelope, Event, EventKind, Heartbeat, SCHEMA, Status, Telemetry, Up, encode,
};

/// An upward message is valid for this long [s].
const VALID: f64 = 5.0;

impl Agent {
    /// Sends `message` in an envelope. Every number in it comes from checked sources; should one not
    /// be finite all the same, the message is dropped, never sent.
    pub(super) fn publish(&mut self, now: Nanos, message: Up) {
        self.up_seq += 1;
        let id = self.mission.id();
        let envelope = Envelope {
            schema: SCHEMA,
            mission_id: if id.is_empty() { "0".repeat(32) } else { id.to_owned() },
            epoch: self.mission.epoch,
            seq: self.up_seq,
            issued: now,
            valid_until: now.plus(VALID),
            body: message,
        };
        let Ok(bytes) = encode(&envelope) else { return };
        self.out.push(Output::Publish { bytes, message: Box::new(envelope.body) });
    }

    pub(super) fn event(&mut self, now: Nanos, kind: EventKind, cause: &str) {
        let event = Event {
            drone: self.config.drone.clone(),
            mission_time: self.mission.time(now),
            kind,
            cause: cause.to_owned(),
        };
        self.publish(now, Up::Event(event));
    }

    pub(super) fn acknowledge(&mut self, now: Nanos, asked: &Asked, outcome: AckResult) {
        let ack = Ack {
            drone: self.config.drone.clone(),
            of: asked.of.clone(),
            epoch: asked.epoch,
            seq: asked.seq,
            outcome,
        };
        self.publish(now, Up::Ack(ack));
    }

    pub(super) fn publish_heartbeat(&mut self, now: Nanos) {
        let heartbeat = Heartbeat {
            drone: self.config.drone.clone(),
            now,
            mode: self.mode,
            hash: self.mission.hash().to_owned(),
            mission_time: self.mission.time(now),
            armed: self.vehicle.armed,
            battery: self.vehicle.battery,
            state_age: self.vehicle.age(now),
        };
        self.publish(now, Up::Heartbeat(heartbeat));
    }

    pub(super) fn publish_telemetry(&mut self, now: Nanos) {
        let t = self.mission.time(now);
        let own = self.mission.committed.as_ref().map(|plan| plan.own());
        let ahead = own.zip(t);
        let telemetry = Telemetry {
            drone: self.config.drone.clone(),
            mode: self.mode,
            mission_time: t,
            state: self.vehicle.state(now),
            reference: self.reference(now),
            setpoint: self.last_setpoint,
            deviation: self.deviation,
            hover_thrust: self.hover.hover_thrust(),
            replans: self.replan.committed,
            next_topic: ahead.and_then(|(own, t)| own.topics.iter().copied().find(|topic| *topic > t)),
            next_region: ahead
                .and_then(|(own, t)| own.visits.iter().find(|visit| visit.t > t))
                .map(|visit| visit.region.clone()),
        };
        self.publish(now, Up::Telemetry(telemetry));
    }

    /// Gives out the status when it has changed.
    pub(super) fn refresh_status(&mut self, now: Nanos) {
        let mission = &self.mission;
        let status = Status {
            drone: self.config.drone.clone(),
            mode: self.mode,
            mission_id: mission.id().to_owned(),
            epoch: mission.epoch,
            seq: mission.seq,
            hash: mission.hash().to_owned(),
            t0: mission.t0,
            preflight: if self.mode == fleet_core::wire::Mode::Idle {
                self.preflight(now)
            } else {
                Vec::new()
            },
        };
        if self.status.as_ref() != Some(&status) {
            self.status = Some(status.clone());
            self.out.push(Output::Status(status));
        }
    }

    /// What this tick saw and did, for the log.
    pub(super) fn log_tick(&mut self, now: Nanos) {
        let tick = Tick {
            mode: self.mode,
            mission_time: self.mission.time(now),
            state: self.vehicle.state(now),
            reference: self.reference(now),
            setpoint: self.last_setpoint,
            deviation: self.deviation,
            hover_thrust: self.hover.hover_thrust(),
        };
        self.out.push(Output::Tick(Box::new(tick)));
    }
}

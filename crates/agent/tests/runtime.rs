//! The control thread against a MAVLink peer on a real socket.
// A test owns sockets and threads, and an unwrap in it is its failure.
#![allow(clippy::disallowed_methods, clippy::unwrap_used, clippy::panic)]

use fleet_agent::config::MavlinkEndpoint;
use fleet_agent::mavlink::Codec;
use fleet_agent::runtime::clock::Clock;
use fleet_agent::runtime::control::{Control, Exit, Outboxes};
use fleet_agent::runtime::queue::Queue;
use fleet_agent::runtime::vehicle_link::VehicleLink;
use fleet_agent::runtime::{Wake, spawn};
use fleet_agent::{Agent, AgentConfig};
use mavlink::dialects::common::{MavMessage, TIMESYNC_DATA};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message};
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const SYSTEM: u8 = 33;

#[test]
fn a_log_that_lost_steps_is_told_how_many() {
    let clock = Clock::start();
    let (wake, woken) = Queue::bounded("wake", 256);
    let link = VehicleLink::open("udpin:127.0.0.1:0".parse().unwrap()).unwrap();
    let (comms, _comms) = Queue::bounded("comms", 4096);
    let (solver, _solver) = Queue::bounded("solver", 4);
    let (disk, _disk) = Queue::bounded("disk", 4);
    let (record, steps) = Queue::bounded("record", 2);
    let control = spawn("control", move || {
        let outboxes = Outboxes { comms, solver, disk, record: Some(record) };
        let agent = Agent::new(AgentConfig::new("fleet", "d1"));
        Control::new(agent, Codec::new(SYSTEM, SYSTEM), clock, link, outboxes).run(&woken, false);
    })
    .unwrap();
    // Two steps fit; nobody reads for as long as some ticks take.
    std::thread::sleep(Duration::from_millis(200));
    let (first, second) = (steps.recv().unwrap(), steps.recv().unwrap());
    let third = steps.recv_timeout(Duration::from_secs(10)).unwrap();
    assert_eq!((first.lost, second.lost), (0, 0));
    assert!(third.lost >= 1);
    let between = third.now.since(second.now);
    assert!(third.lost as f64 <= between / 0.009, "{} in {between} s", third.lost);
    wake.offer(Wake::Signal).unwrap();
    // The thread sees that nobody reads any more and ends by the signal all the same.
    drop(steps);
    control.join().unwrap();
}

struct Running {
    address: SocketAddr,
    wake: Queue<Wake>,
    stop: Arc<AtomicBool>,
    exit: Receiver<Exit>,
}

impl Running {
    fn start(endpoint: &str) -> Self {
        let endpoint: MavlinkEndpoint = endpoint.parse().unwrap();
        let clock = Clock::start();
        let (wake, woken) = Queue::bounded("wake", 256);
        let link = VehicleLink::open(endpoint).unwrap();
        let address = link.local_address().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        link.read(wake.clone(), Arc::clone(&stop)).unwrap();
        let (comms, _comms) = Queue::bounded("comms", 64);
        let (solver, _solver) = Queue::bounded("solver", 4);
        let (disk, _disk) = Queue::bounded("disk", 4);
        let (ended, exit) = channel();
        spawn("control", move || {
            let outboxes = Outboxes { comms, solver, disk, record: None };
            let agent = Agent::new(AgentConfig::new("fleet", "d1"));
            let mut control = Control::new(agent, Codec::new(SYSTEM, SYSTEM), clock, link, outboxes);
            ended.send(control.run(&woken, false)).unwrap();
        })
        .unwrap();
        Self { address, wake, stop, exit }
    }

    fn end(self) -> Exit {
        self.wake.offer(Wake::Signal).unwrap();
        let exit = self.exit.recv_timeout(Duration::from_secs(10)).unwrap();
        self.stop.store(true, Ordering::Relaxed);
        exit
    }
}

fn peer() -> UdpSocket {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    socket
}

fn timesync(system: u8, ts1: i64) -> Vec<u8> {
    let message = MavMessage::TIMESYNC(TIMESYNC_DATA { ts1, ..Default::default() });
    let mut raw = MAVLinkV2MessageRaw::new();
    let header = MavHeader { system_id: system.into(), component_id: 1, sequence: 0 };
    raw.serialize_message(header, &message);
    raw.raw_bytes().to_vec()
}

/// The `ts1` of the next TIMESYNC answer; other messages of the agent are passed over.
fn next_answer(socket: &UdpSocket) -> i64 {
    let mut buffer = [0; 300];
    for _ in 0..1000 {
        let (length, _) = socket.recv_from(&mut buffer).unwrap();
        let id = u32::from_le_bytes([buffer[7], buffer[8], buffer[9], 0]);
        let payload = &buffer[10..length - 2];
        if let Ok(MavMessage::TIMESYNC(data)) = MavMessage::parse(MavlinkVersion::V2, id, payload) {
            assert!(data.tc1 > 0, "the agent's clock");
            return data.ts1;
        }
    }
    panic!("no answer among 1000 datagrams");
}

#[test]
fn a_listening_agent_answers_its_first_speaker_alone() {
    let agent = Running::start("udpin:127.0.0.1:0");
    let (first, second) = (peer(), peer());
    first.send_to(&[0xfd; 100], agent.address).unwrap();
    first.send_to(&timesync(SYSTEM + 1, 1), agent.address).unwrap();
    first.send_to(&timesync(SYSTEM, 11), agent.address).unwrap();
    assert_eq!(next_answer(&first), 11, "junk and another system's request are not answered");
    second.send_to(&timesync(SYSTEM, 22), agent.address).unwrap();
    first.send_to(&timesync(SYSTEM, 33), agent.address).unwrap();
    assert_eq!(next_answer(&first), 33);
    second.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    assert!(second.recv_from(&mut [0; 300]).is_err(), "nobody else is answered while it speaks");
    assert_eq!(agent.end(), Exit::Signal);
}

#[test]
fn a_sending_agent_hears_its_address_alone() {
    let (autopilot, stranger) = (peer(), peer());
    let agent = Running::start(&format!("udpout:{}", autopilot.local_addr().unwrap()));
    stranger.send_to(&timesync(SYSTEM, 1), agent.address).unwrap();
    autopilot.send_to(&timesync(SYSTEM, 2), agent.address).unwrap();
    assert_eq!(next_answer(&autopilot), 2);
    assert_eq!(agent.end(), Exit::Signal);
}

#[test]
fn a_flood_of_junk_does_not_keep_it_from_ending() {
    let agent = Running::start("udpin:127.0.0.1:0");
    let socket = peer();
    for round in 0..2000_u32 {
        let junk: Vec<u8> = (0..200).map(|i| (round.wrapping_mul(2_654_435_761) >> (i % 24)) as u8).collect();
        socket.send_to(&junk, agent.address).unwrap();
    }
    // Signals share the queue with datagrams; this one must get through once the flood is over.
    let mut wake = agent.wake.offer(Wake::Signal);
    while let Err(message) = wake {
        std::thread::sleep(Duration::from_millis(1));
        wake = agent.wake.offer(message);
    }
    assert_eq!(agent.exit.recv_timeout(Duration::from_secs(10)).unwrap(), Exit::Signal);
    agent.stop.store(true, Ordering::Relaxed);
}

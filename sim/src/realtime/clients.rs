//! One vehicle's UDP socket and the clients that write to it.

use crate::exit::Failure;
use fleet_core::types::Nanos;
use fleet_sim::autopilot::{LinkId, Outgoing};
use fleet_sim::framing::{Encoder, deliver};
use fleet_sim::world::Vehicle;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};

/// A client that has not written for so long gets nothing any more [s].
const SILENCE: f64 = 10.0;
/// Largest UDP datagram taken; a MAVLink 2 frame has at most 280 bytes, and clients may pack some.
const DATAGRAM: usize = 4096;
/// Most datagrams taken in one go, so that a flood cannot stop the physics.
const BURST: usize = 256;

#[derive(Debug)]
struct Client {
    link: LinkId,
    heard: Nanos,
    encoder: Encoder,
}

/// The socket of one vehicle.
#[derive(Debug)]
pub struct Clients {
    socket: UdpSocket,
    clients: BTreeMap<SocketAddr, Client>,
    next_link: u32,
}

impl Clients {
    /// Listens on `address`.
    ///
    /// # Errors
    /// When the address is taken or not allowed.
    // The simulator's binary owns its sockets.
    #[allow(clippy::disallowed_methods)]
    pub fn bind(id: &str, address: SocketAddr) -> Result<Self, Failure> {
        let refused = |error: std::io::Error| {
            Failure::Environment(format!("vehicle {id}: cannot listen on {address} (UDP): {error}"))
        };
        let socket = UdpSocket::bind(address).map_err(refused)?;
        socket.set_nonblocking(true).map_err(refused)?;
        Ok(Self { socket, clients: BTreeMap::new(), next_link: 0 })
    }

    /// The address that it listens on.
    ///
    /// # Errors
    /// When the system does not say.
    pub fn address(&self) -> Result<SocketAddr, Failure> {
        self.socket.local_addr().map_err(|error| Failure::Environment(error.to_string()))
    }

    /// Gives everything that has arrived to the vehicle's autopilot and forgets silent clients.
    pub fn receive(&mut self, now: Nanos, vehicle: &mut Vehicle) {
        let mut buffer = [0; DATAGRAM];
        let system = vehicle.autopilot().system();
        for _ in 0..BURST {
            let (length, sender) = match self.socket.recv_from(&mut buffer) {
                Ok(got) => got,
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                // A client that closed its socket shows as an error here; it is dropped when silent.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => continue,
                Err(error) => {
                    tracing::warn!(vehicle = vehicle.id(), %error, "cannot receive");
                    break;
                }
            };
            let next_link = &mut self.next_link;
            let client = self.clients.entry(sender).or_insert_with(|| {
                *next_link += 1;
                tracing::info!(vehicle = vehicle.id(), %sender, "client connected");
                Client { link: LinkId(*next_link), heard: now, encoder: Encoder::new(system) }
            });
            client.heard = now;
            vehicle.autopilot_mut().open_link(now, client.link);
            deliver(vehicle.autopilot_mut(), now, client.link, &buffer[..length]);
        }
        self.clients.retain(|sender, client| {
            let keep = now.since(client.heard) <= SILENCE;
            if !keep {
                tracing::info!(vehicle = vehicle.id(), %sender, "client is silent; dropped");
                vehicle.autopilot_mut().close_link(client.link);
            }
            keep
        });
    }

    /// Sends what the autopilot has to say.
    pub fn send(&mut self, id: &str, outgoing: &[Outgoing]) {
        for message in outgoing {
            let Some((address, client)) = self.clients.iter_mut().find(|(_, c)| c.link == message.link)
            else {
                continue;
            };
            let bytes = client.encoder.encode(message);
            match self.socket.send_to(&bytes, address) {
                Ok(_) => {}
                // The client's socket is gone or full: UDP may lose it, as a radio would.
                Err(error)
                    if matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock) => {}
                Err(error) => tracing::warn!(vehicle = id, %address, %error, "cannot send"),
            }
        }
    }
}

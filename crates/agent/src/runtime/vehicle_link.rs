//! The UDP socket to the autopilot.

use super::queue::Queue;
use super::{RuntimeError, Wake};
use crate::config::MavlinkEndpoint;
use fleet_core::types::Nanos;
use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Largest UDP payload.
const DATAGRAM: usize = 65_507;
/// How often the reader looks whether it should end.
const READ_TIMEOUT: Duration = Duration::from_millis(100);
/// A send that takes longer is given up: the control thread does not wait for a full buffer.
const WRITE_TIMEOUT: Duration = Duration::from_millis(1);
/// A listening link answers its first speaker until that one is silent for so long [s].
const PEER_SILENCE: f64 = 2.0;

/// Sends to the autopilot; belongs to the control thread.
#[derive(Debug)]
pub struct VehicleLink {
    socket: UdpSocket,
    endpoint: MavlinkEndpoint,
    peer: Option<(SocketAddr, Nanos)>,
    failures: u64,
}

impl VehicleLink {
    /// Binds the socket.
    ///
    /// # Errors
    /// When the address cannot be bound.
    // The agent's one socket towards the vehicle.
    #[allow(clippy::disallowed_methods)]
    pub fn open(endpoint: MavlinkEndpoint) -> Result<Self, RuntimeError> {
        let failed = |source| RuntimeError::Mavlink { endpoint, source };
        let socket = match endpoint {
            MavlinkEndpoint::Listen(address) => UdpSocket::bind(address),
            MavlinkEndpoint::Send(address) => bind_towards(address),
        };
        let socket = socket.map_err(failed)?;
        socket.set_read_timeout(Some(READ_TIMEOUT)).map_err(failed)?;
        socket.set_write_timeout(Some(WRITE_TIMEOUT)).map_err(failed)?;
        Ok(Self { socket, endpoint, peer: None, failures: 0 })
    }

    /// The address that the socket is bound to.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn local_address(&self) -> Result<SocketAddr, RuntimeError> {
        self.socket.local_addr().map_err(|source| RuntimeError::Mavlink { endpoint: self.endpoint, source })
    }

    /// Whether a datagram from `from` may be read: a sending link hears only its address, a
    /// listening one its first speaker, or a new one once that is silent.
    #[must_use]
    pub fn accepts(&self, from: SocketAddr, now: Nanos) -> bool {
        match self.endpoint {
            MavlinkEndpoint::Send(address) => from == address,
            MavlinkEndpoint::Listen(_) => {
                self.peer.is_none_or(|(peer, heard)| peer == from || now.since(heard) > PEER_SILENCE)
            }
        }
    }

    /// Notes that the autopilot spoke from `from`.
    pub fn heard(&mut self, from: SocketAddr, now: Nanos) {
        if self.peer.map(|(peer, _)| peer) != Some(from) {
            tracing::info!(%from, "autopilot heard");
        }
        self.peer = Some((from, now));
    }

    /// Sends one datagram; does nothing while a listening link has heard nobody.
    pub fn send(&mut self, bytes: &[u8]) {
        let to = match (self.endpoint, self.peer) {
            (MavlinkEndpoint::Send(address), _) => address,
            (MavlinkEndpoint::Listen(_), Some((peer, _))) => peer,
            (MavlinkEndpoint::Listen(_), None) => return,
        };
        if let Err(error) = self.socket.send_to(bytes, to) {
            self.failures += 1;
            if self.failures.is_power_of_two() {
                tracing::warn!(%to, failures = self.failures, %error, "cannot send to the autopilot");
            }
        }
    }

    /// Starts the thread that puts datagrams on `wake` until `stop` is set.
    ///
    /// # Errors
    /// When the system gives no second handle or no thread.
    pub fn read(&self, wake: Queue<Wake>, stop: Arc<AtomicBool>) -> Result<JoinHandle<()>, RuntimeError> {
        let socket = self
            .socket
            .try_clone()
            .map_err(|source| RuntimeError::Mavlink { endpoint: self.endpoint, source })?;
        super::spawn("mavlink", move || read_loop(&socket, &wake, &stop))
    }
}

#[allow(clippy::disallowed_methods)]
fn bind_towards(address: SocketAddr) -> std::io::Result<UdpSocket> {
    let any: IpAddr = match (address, address.ip().is_loopback()) {
        (SocketAddr::V4(_), true) => [127, 0, 0, 1].into(),
        (SocketAddr::V4(_), false) => [0, 0, 0, 0].into(),
        (SocketAddr::V6(_), true) => std::net::Ipv6Addr::LOCALHOST.into(),
        (SocketAddr::V6(_), false) => std::net::Ipv6Addr::UNSPECIFIED.into(),
    };
    UdpSocket::bind((any, 0))
}

// A broken socket must not turn this thread into a busy loop.
#[allow(clippy::disallowed_methods)]
fn read_loop(socket: &UdpSocket, wake: &Queue<Wake>, stop: &AtomicBool) {
    let mut buffer = vec![0; DATAGRAM];
    while !stop.load(Ordering::Relaxed) {
        match socket.recv_from(&mut buffer) {
            // A refused datagram is counted by the queue; newer ones will follow.
            Ok((length, from)) => {
                let _ = wake.offer(Wake::Datagram { bytes: buffer[..length].to_vec(), from });
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => {
                tracing::debug!(%error, "cannot receive from the autopilot");
                std::thread::sleep(Duration::from_millis(10));
            }
        }
    }
}

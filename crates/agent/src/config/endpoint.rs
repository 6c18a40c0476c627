//! Addresses as the user writes them.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;

/// Where the autopilot's MAVLink is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum MavlinkEndpoint {
    /// `udpin:ADDR:PORT`: bind there and answer who sends; port 0 takes a free one.
    Listen(SocketAddr),
    /// `udpout:ADDR:PORT`: send there from a free port.
    Send(SocketAddr),
}

impl MavlinkEndpoint {
    /// The address in it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        match self {
            Self::Listen(address) | Self::Send(address) => *address,
        }
    }
}

impl FromStr for MavlinkEndpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let legal = || {
            format!(
                "{text:?} is not a MAVLink endpoint; legal is udpin:ADDR:PORT or udpout:ADDR:PORT, for example udpin:127.0.0.1:14540"
            )
        };
        let (kind, address) = text.split_once(':').ok_or_else(legal)?;
        let address: SocketAddr = address.parse().map_err(|_| legal())?;
        match kind {
            "udpin" => Ok(Self::Listen(address)),
            "udpout" if address.port() != 0 => Ok(Self::Send(address)),
            _ => Err(legal()),
        }
    }
}

impl fmt::Display for MavlinkEndpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Listen(address) => write!(f, "udpin:{address}"),
            Self::Send(address) => write!(f, "udpout:{address}"),
        }
    }
}

impl TryFrom<String> for MavlinkEndpoint {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<MavlinkEndpoint> for String {
    fn from(endpoint: MavlinkEndpoint) -> Self {
        endpoint.to_string()
    }
}

/// The host in a Zenoh endpoint `tcp/HOST:PORT`, `tls/...` or `udp/...`.
///
/// # Errors
/// Says what is legal.
pub fn zenoh_host(endpoint: &str) -> Result<&str, String> {
    let legal = || {
        format!(
            "{endpoint:?} is not a Zenoh endpoint; legal is tcp/HOST:PORT, tls/HOST:PORT or udp/HOST:PORT, for example tcp/127.0.0.1:7447"
        )
    };
    let (protocol, rest) = endpoint.split_once('/').ok_or_else(legal)?;
    if !["tcp", "tls", "udp"].contains(&protocol) {
        return Err(legal());
    }
    let address = rest.split(['?', '#']).next().unwrap_or(rest);
    let (host, port) = address.rsplit_once(':').ok_or_else(legal)?;
    let host = host.strip_prefix('[').and_then(|h| h.strip_suffix(']')).unwrap_or(host);
    if host.is_empty() || port.parse::<u16>().is_err() {
        return Err(legal());
    }
    Ok(host)
}

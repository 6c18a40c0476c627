//! The thread that owns the Zenoh session. No Zenoh call is made anywhere else.

use super::clock::Clock;
use super::plans::Plans;
use super::queue::Queue;
use super::{Wake, spawn};
use crate::io::Input;
use fleet_core::wire::keys::{self, DownChannel, Query as QueryName, UpChannel};
use fleet_core::wire::{self, Status, TimeReply, Up};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::query::Query;
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};

/// Time between attempts to open a session at all; within a session zenoh retries by itself.
const RETRY: Duration = Duration::from_millis(200);

/// What goes out.
#[derive(Debug)]
pub enum Outgoing {
    /// A message of the drone.
    Publish {
        /// Its channel.
        channel: UpChannel,
        /// The envelope.
        bytes: Vec<u8>,
    },
    /// What the `status` query answers from now on.
    Status(Box<Status>),
}

/// Which channel a message goes out on.
#[must_use]
pub fn channel(message: &Up) -> UpChannel {
    match message {
        Up::Heartbeat(_) => UpChannel::Heartbeat,
        Up::Telemetry(_) => UpChannel::Telemetry,
        Up::Event(_) => UpChannel::Event,
        Up::Ack(_) => UpChannel::Ack,
        Up::Replan(_) => UpChannel::Replan,
    }
}

/// Who speaks and to whom.
#[derive(Clone, Debug)]
pub struct Comms {
    /// Name of the fleet.
    pub fleet: String,
    /// Id of this drone.
    pub drone: String,
    /// Endpoints of the router.
    pub endpoints: Vec<String>,
    /// Answers the `time` query.
    pub clock: Clock,
    /// Holds the committed plan.
    pub plans: Plans,
    /// Takes what arrives.
    pub wake: Queue<Wake>,
    /// Set once a session is open.
    pub open: Arc<AtomicBool>,
}

type Shared = Arc<Mutex<Option<Status>>>;
type ZResult<T> = Result<T, zenoh::Error>;

impl Comms {
    /// Starts the thread; it ends when the queue's last sender is gone.
    ///
    /// # Errors
    /// When the system gives no thread.
    pub fn start(self, outgoing: Receiver<Outgoing>) -> Result<JoinHandle<()>, super::RuntimeError> {
        spawn("comms", move || self.run(&outgoing))
    }

    // Waiting between attempts is this thread's business alone.
    #[allow(clippy::disallowed_methods)]
    fn run(&self, outgoing: &Receiver<Outgoing>) {
        let status = Shared::default();
        // The liveliness token is withdrawn when it is dropped.
        let (session, _token) = loop {
            match self.open(&status) {
                Ok(opened) => break opened,
                Err(error) => tracing::warn!(%error, "cannot open a Zenoh session"),
            }
            std::thread::sleep(RETRY);
        };
        tracing::info!(endpoints = ?self.endpoints, "Zenoh session is open");
        self.open.store(true, Ordering::Relaxed);
        // What waited for the session is old by now; only events and the status still tell something.
        let old = outgoing.try_iter().filter(|message| match message {
            Outgoing::Publish { channel, .. } => *channel == UpChannel::Event,
            Outgoing::Status(_) => true,
        });
        for message in old.collect::<Vec<_>>().into_iter().chain(outgoing) {
            match message {
                Outgoing::Publish { channel, bytes } => {
                    if let Err(error) = self.publish(&session, channel, bytes) {
                        tracing::warn!(%error, ?channel, "cannot publish");
                    }
                }
                Outgoing::Status(new) => {
                    *status.lock().unwrap_or_else(PoisonError::into_inner) = Some(*new);
                }
            }
        }
        if let Err(error) = session.close().wait() {
            tracing::debug!(%error, "closing the Zenoh session");
        }
    }

    fn publish(&self, session: &Session, channel: UpChannel, bytes: Vec<u8>) -> ZResult<()> {
        let congestion = match channel {
            UpChannel::Telemetry => CongestionControl::Drop,
            _ => CongestionControl::Block,
        };
        session
            .put(keys::up(&self.fleet, &self.drone, channel), bytes)
            .congestion_control(congestion)
            .express(true)
            .wait()
    }

    fn open(&self, status: &Shared) -> ZResult<(Session, LivelinessToken)> {
        let session = zenoh::open(config(&self.endpoints)?).wait()?;
        for channel in [DownChannel::Plan, DownChannel::Commit, DownChannel::Cmd] {
            let this = self.clone();
            session
                .declare_subscriber(keys::down(&self.fleet, &self.drone, channel))
                .callback(move |sample| this.take_down(&sample))
                .background()
                .wait()?;
        }
        for channel in [UpChannel::Heartbeat, UpChannel::Replan] {
            let own = keys::up(&self.fleet, &self.drone, channel);
            let this = self.clone();
            session
                .declare_subscriber(keys::up(&self.fleet, "*", channel))
                .callback(move |sample| this.take_peer(&sample, &own))
                .background()
                .wait()?;
        }
        self.answer(&session, QueryName::Time, {
            let clock = self.clock;
            move || wire::encode(&TimeReply { now: clock.now() }).map_err(|error| error.to_string())
        })?;
        self.answer(&session, QueryName::Status, {
            let status = Arc::clone(status);
            move || wire::encode(&known(&status)?).map_err(|error| error.to_string())
        })?;
        self.answer(&session, QueryName::Plan, {
            let (status, plans) = (Arc::clone(status), self.plans.clone());
            move || {
                let hash = known(&status)?.hash;
                plans
                    .get(&hash)
                    .map(|file| file.bytes.clone())
                    .ok_or_else(|| "no plan is committed".to_owned())
            }
        })?;
        let token = session.liveliness().declare_token(keys::alive(&self.fleet, &self.drone)).wait()?;
        Ok((session, token))
    }

    fn take_down(&self, sample: &Sample) {
        let bytes = sample.payload().to_bytes();
        // Larger messages are refused by the step unread; they must not fill the queue or the log.
        if bytes.len() > wire::MAX_BYTES + ENVELOPE {
            tracing::warn!(bytes = bytes.len(), key = %sample.key_expr(), "message is too large, dropped");
            return;
        }
        let _ = self.wake.offer(Wake::Input(Input::Ground { bytes: bytes.into_owned() }));
    }

    fn take_peer(&self, sample: &Sample, own: &str) {
        if sample.key_expr().as_str() == own {
            return;
        }
        let bytes = sample.payload().to_bytes();
        if bytes.len() <= PEER_BYTES {
            let _ = self.wake.offer(Wake::Input(Input::Peer { bytes: bytes.into_owned() }));
        }
    }

    fn answer(
        &self,
        session: &Session,
        name: QueryName,
        reply: impl Fn() -> Result<Vec<u8>, String> + Send + Sync + 'static,
    ) -> ZResult<()> {
        let key = keys::query(&self.fleet, &self.drone, name);
        let under = key.clone();
        session
            .declare_queryable(key)
            .callback(move |query: Query| {
                let sent = match reply() {
                    Ok(bytes) => query.reply(under.as_str(), bytes).express(true).wait(),
                    Err(reason) => query.reply_err(reason).wait(),
                };
                if let Err(error) = sent {
                    tracing::warn!(%error, ?name, "cannot answer");
                }
            })
            .background()
            .wait()
    }
}

/// Room for the header around a plan of the largest size.
const ENVELOPE: usize = 4096;
/// Largest message of a peer [bytes]: a replan notice of 512 segments takes a quarter of it.
const PEER_BYTES: usize = 256 * 1024;

fn known(status: &Shared) -> Result<Status, String> {
    let status = status.lock().unwrap_or_else(PoisonError::into_inner);
    status.clone().ok_or_else(|| "no status yet".to_owned())
}

/// Client of explicit endpoints, no multicast, for ever retrying (design.md, Zenoh).
fn config(endpoints: &[String]) -> ZResult<Config> {
    let mut config = Config::default();
    let quoted = |text: &String| format!("{text:?}");
    let endpoints = endpoints.iter().map(quoted).collect::<Vec<_>>().join(",");
    let settings = [
        ("mode", "\"client\"".to_owned()),
        ("connect/endpoints", format!("[{endpoints}]")),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        ("connect/retry", "{period_init_ms: 200, period_max_ms: 200, period_increase_factor: 1}".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ];
    for (key, value) in settings {
        config.insert_json5(key, &value)?;
    }
    Ok(config)
}

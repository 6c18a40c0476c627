//! Commands on standard input, one JSON object a line.

use serde::Deserialize;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};

/// A command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Mission time 0 in Unix time [ns].
    pub t0_unix_ns: u64,
}

/// Standard input, read by a thread of its own because reading blocks.
#[derive(Debug)]
pub struct Stdin {
    lines: Receiver<Line>,
    ended: bool,
}

impl Stdin {
    /// Begins to read.
    // Blocking reads need a thread; it ends with the process.
    #[allow(clippy::disallowed_methods)]
    pub fn open() -> Self {
        let (sender, lines) = channel();
        std::thread::spawn(move || read_lines(&sender));
        Self { lines, ended: false }
    }

    /// The next command, if one has come.
    pub fn next(&mut self) -> Option<Line> {
        match self.lines.try_recv() {
            Ok(line) => Some(line),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => {
                self.ended = true;
                None
            }
        }
    }

    /// Whether it was closed.
    pub fn ended(&self) -> bool {
        self.ended
    }
}

fn read_lines(sender: &Sender<Line>) {
    for line in std::io::stdin().lock().lines() {
        let Ok(line) = line else { return };
        if line.trim().is_empty() {
            continue;
        }
        match serde_json::from_str(&line) {
            Ok(command) => {
                if sender.send(command).is_err() {
                    return;
                }
            }
            Err(error) => tracing::error!(%line, %error, r#"stdin: legal is {{"t0_unix_ns": N}}"#),
        }
    }
}

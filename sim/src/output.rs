//! JSON lines on stdout, the program's interface to its caller.

use serde::Serialize;
use std::io::Write;

/// Prints one JSON line at once.
pub fn print_line(value: &impl Serialize) {
    let mut out = std::io::stdout().lock();
    let written = serde_json::to_string(value)
        .map_err(std::io::Error::other)
        .and_then(|line| writeln!(out, "{line}"))
        .and_then(|()| out.flush());
    // A reader that has gone away is not a reason to drop the vehicles.
    if let Err(error) = written {
        tracing::warn!(%error, "stdout is closed");
    }
}

//! The thread that writes what must survive a power cut.

use super::Wake;
use super::plans::Plans;
use super::queue::Queue;
use crate::io::{Input, PLAN_FILE};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

/// A file to write.
#[derive(Debug)]
pub struct Job {
    /// Number that the answer carries.
    pub id: u64,
    /// File name without directory.
    pub name: String,
    /// Content.
    pub bytes: Vec<u8>,
}

/// Writes until the jobs end; every job is answered on the wake queue. A committed plan is also
/// noted in `plans`, before the answer.
pub fn run(directory: &Path, plans: &Plans, jobs: &Receiver<Job>, wake: &Queue<Wake>) {
    for job in jobs {
        let ok = match write_atomically(directory, &job.name, &job.bytes) {
            Ok(path) => {
                tracing::debug!(path = %path.display(), bytes = job.bytes.len(), "written");
                note(plans, job.name == PLAN_FILE, job.bytes)
            }
            Err(error) => {
                tracing::error!(directory = %directory.display(), name = job.name, %error, "cannot write");
                false
            }
        };
        if wake.offer(Wake::Input(Input::Persisted { id: job.id, ok })).is_err() {
            tracing::error!(id = job.id, "a file was written but the answer is lost");
        }
    }
}

fn note(plans: &Plans, is_plan: bool, bytes: Vec<u8>) -> bool {
    if !is_plan {
        return true;
    }
    match plans.note(bytes) {
        Ok(()) => true,
        Err(error) => {
            tracing::error!(%error, "the committed plan cannot be read back");
            false
        }
    }
}

/// Writes a temporary file, flushes it to disk, renames it and flushes the directory: after a
/// power cut there is either the old file or the new one.
///
/// # Errors
/// When the name is not a plain file name, or the disk refuses.
// This thread exists to touch the disk.
#[allow(clippy::disallowed_methods)]
pub fn write_atomically(directory: &Path, name: &str, bytes: &[u8]) -> io::Result<PathBuf> {
    let plain = Path::new(name).file_name().is_some_and(|file| file == name);
    if !plain {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("{name:?} is not a file name")));
    }
    fs::create_dir_all(directory)?;
    let path = directory.join(name);
    let temporary = directory.join(format!("{name}.tmp"));
    let mut file = File::create(&temporary)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&temporary, &path)?;
    File::open(directory)?.sync_all()?;
    Ok(path)
}

#[cfg(test)]
// Tests read back what was written.
#[allow(clippy::disallowed_methods)]
mod tests {
    use super::*;

    #[test]
    fn writes_replaces_and_leaves_no_temporary_file() {
        let directory = std::env::temp_dir().join(format!("fleet-persist-{}", std::process::id()));
        for content in [b"one".as_slice(), b"two"] {
            let path = write_atomically(&directory, "plan.cbor", content).unwrap();
            assert_eq!(fs::read(path).unwrap(), content);
        }
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1);
        for name in ["../x", "a/b", "", "..", "/etc/x"] {
            assert!(write_atomically(&directory, name, b"").is_err(), "{name:?}");
        }
        fs::remove_dir_all(&directory).unwrap();
    }
}

//! Plans that were offered, for the threads that need more than the step puts out.

use fleet_core::wire::{self, Down, Envelope, Plan};
use std::sync::{Arc, Mutex, PoisonError};

/// How many offers are remembered: the committed plan, the next one, and some that were refused.
const REMEMBERED: usize = 4;

/// A plan file and its content.
#[derive(Debug)]
pub struct PlanFile {
    /// SHA-256 of the bytes.
    pub hash: String,
    /// The file.
    pub bytes: Vec<u8>,
    /// Its content.
    pub plan: Plan,
}

/// The last offers, by hash. Shared by comms and solver threads; the control thread never locks it.
#[derive(Clone, Debug, Default)]
pub struct Plans {
    files: Arc<Mutex<Vec<Arc<PlanFile>>>>,
}

impl Plans {
    /// Remembers the plan in an offer; anything else, or a plan that does not match its hash, is
    /// left to the step to refuse.
    pub fn note(&self, envelope: &[u8]) {
        let Ok(Envelope { body: Down::Offer(offer), .. }) = Envelope::<Down>::from_bytes(envelope) else {
            return;
        };
        self.note_file(offer.plan, &offer.hash);
    }

    fn note_file(&self, bytes: Vec<u8>, hash: &str) {
        if wire::plan_hash(&bytes) != hash || self.get(hash).is_some() {
            return;
        }
        let Ok(plan) = wire::decode::<Plan>(&bytes) else { return };
        let file = Arc::new(PlanFile { hash: hash.to_owned(), bytes, plan });
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if files.len() == REMEMBERED {
            files.remove(0);
        }
        files.push(file);
    }

    /// The plan with this hash; asking for it keeps it from being forgotten next.
    #[must_use]
    pub fn get(&self, hash: &str) -> Option<Arc<PlanFile>> {
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        let at = files.iter().position(|file| file.hash == hash)?;
        let file = files.remove(at);
        files.push(Arc::clone(&file));
        Some(file)
    }
}

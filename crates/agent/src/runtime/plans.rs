//! Plans that were committed, for the threads that need more of them than the step puts out.

use fleet_core::wire::{self, Plan};
use std::sync::{Arc, Mutex, PoisonError};

/// How many are remembered: the committed plan and the ones before it.
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

/// The last plans, by hash. Shared by disk, comms and solver threads; the control thread never locks
/// it.
#[derive(Clone, Debug, Default)]
pub struct Plans {
    files: Arc<Mutex<Vec<Arc<PlanFile>>>>,
}

impl Plans {
    /// Remembers a plan file.
    ///
    /// # Errors
    /// When the bytes are no plan.
    pub fn note(&self, bytes: Vec<u8>) -> Result<(), wire::DecodeError> {
        let hash = wire::plan_hash(&bytes);
        if self.get(&hash).is_some() {
            return Ok(());
        }
        let plan = wire::decode::<Plan>(&bytes)?;
        let file = Arc::new(PlanFile { hash, bytes, plan });
        let mut files = self.files.lock().unwrap_or_else(PoisonError::into_inner);
        if files.len() == REMEMBERED {
            files.remove(0);
        }
        files.push(file);
        Ok(())
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

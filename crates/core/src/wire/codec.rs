//! The one encode and the one decode.

use super::{Envelope, Plan, SCHEMA};
use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use thiserror::Error;

/// Largest message or plan file [bytes]: the largest fleet, 64 drones on a line of 32 towers, takes 1.3 MB
/// (design.md, Wire).
pub const MAX_BYTES: usize = 2 * 1024 * 1024;
/// Deepest nesting of lists and maps in a message; bounds the stack on hostile input.
pub const MAX_DEPTH: usize = 64;

/// Why bytes are not a message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DecodeError {
    /// Larger than [`MAX_BYTES`].
    #[error("{0} bytes; at most 2097152 are legal")]
    TooLarge(usize),
    /// Not CBOR of the expected shape, or a value is not legal.
    #[error("not a valid message: {0}")]
    Malformed(String),
    /// Bytes are left after the message.
    #[error("{0} bytes are left after the message")]
    Trailing(usize),
    /// Another version of the format.
    #[error("schema {0}; this build speaks 1")]
    Schema(u16),
    /// Lists and maps are nested deeper than [`MAX_DEPTH`].
    #[error("nested deeper than 64 levels")]
    TooDeep,
    /// A number is NaN or infinite.
    #[error("a number is not finite")]
    NotFinite,
}

/// CBOR of `value` with named fields.
///
/// # Errors
/// When the value could not be decoded again: too large, too deep, or with a number that is not finite.
pub fn encode<T: Serialize>(value: &T) -> Result<Vec<u8>, DecodeError> {
    let tree =
        ciborium::Value::serialized(value).map_err(|error| DecodeError::Malformed(error.to_string()))?;
    check(&tree, MAX_DEPTH)?;
    let mut bytes = Vec::new();
    ciborium::into_writer(&tree, &mut bytes).map_err(|error| DecodeError::Malformed(error.to_string()))?;
    if bytes.len() > MAX_BYTES {
        return Err(DecodeError::TooLarge(bytes.len()));
    }
    Ok(bytes)
}

/// Reads exactly one value; refuses oversize, trailing bytes and non-finite numbers.
///
/// # Errors
/// See [`DecodeError`].
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    if bytes.len() > MAX_BYTES {
        return Err(DecodeError::TooLarge(bytes.len()));
    }
    let mut rest = bytes;
    let tree: ciborium::Value = ciborium::de::from_reader_with_recursion_limit(&mut rest, MAX_DEPTH)
        .map_err(|error| match error {
            ciborium::de::Error::RecursionLimitExceeded => DecodeError::TooDeep,
            other => DecodeError::Malformed(other.to_string()),
        })?;
    if !rest.is_empty() {
        return Err(DecodeError::Trailing(rest.len()));
    }
    check(&tree, MAX_DEPTH)?;
    tree.deserialized().map_err(|error| DecodeError::Malformed(error.to_string()))
}

impl<T: DeserializeOwned> Envelope<T> {
    /// Reads one envelope and checks its version.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DecodeError> {
        let envelope: Self = decode(bytes)?;
        if envelope.schema == SCHEMA { Ok(envelope) } else { Err(DecodeError::Schema(envelope.schema)) }
    }
}

impl Plan {
    /// Reads a plan file and checks its version.
    ///
    /// # Errors
    /// See [`DecodeError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DecodeError> {
        let plan: Self = decode(bytes)?;
        if plan.schema == SCHEMA { Ok(plan) } else { Err(DecodeError::Schema(plan.schema)) }
    }
}

/// SHA-256 of a plan file's bytes, in hex.
#[must_use]
pub fn plan_hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Numbers are finite, and lists and maps are nested at most `depth` deep.
fn check(value: &ciborium::Value, depth: usize) -> Result<(), DecodeError> {
    use ciborium::Value;
    let inner = || depth.checked_sub(1).ok_or(DecodeError::TooDeep);
    match value {
        Value::Float(x) if !x.is_finite() => Err(DecodeError::NotFinite),
        Value::Array(items) => {
            let depth = inner()?;
            items.iter().try_for_each(|item| check(item, depth))
        }
        Value::Map(pairs) => {
            let depth = inner()?;
            pairs.iter().try_for_each(|(k, v)| check(k, depth).and_then(|()| check(v, depth)))
        }
        Value::Tag(_, tagged) => check(tagged, inner()?),
        _ => Ok(()),
    }
}

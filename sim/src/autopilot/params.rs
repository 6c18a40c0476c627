//! The parameters that are served and, most of them, obeyed.

use thiserror::Error;

/// A parameter's value with its MAVLink type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Value {
    /// `MAV_PARAM_TYPE_INT32`; travels as a bit pattern (PX4, `PARAM_ENCODE_BYTEWISE`).
    Int(i32),
    /// `MAV_PARAM_TYPE_REAL32`.
    Real(f32),
}

impl Value {
    /// The float that carries it in PARAM_VALUE and PARAM_SET.
    #[must_use]
    pub fn to_wire(self) -> f32 {
        match self {
            Self::Int(x) => f32::from_bits(x as u32),
            Self::Real(x) => x,
        }
    }

    /// A new value of the same type from the float of PARAM_SET.
    #[must_use]
    pub fn with_wire(self, wire: f32) -> Self {
        match self {
            Self::Int(_) => Self::Int(wire.to_bits() as i32),
            Self::Real(_) => Self::Real(wire),
        }
    }
}

/// Why a parameter cannot be set.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ParamError {
    /// No such name.
    #[error("no parameter {0}; known are {known}", known = names())]
    Unknown(String),
    /// An integer parameter got a fraction, or a number is out of its type's range.
    #[error("{name} = {value}: an integer is wanted")]
    NotInteger {
        /// Which.
        name: String,
        /// What it got.
        value: f64,
    },
}

/// Name and default, sorted by name, so that an index is stable. Defaults are those measured on
/// PX4 main of December 2024 or its parameter reference; none had to be changed to fly by rates.
const DEFAULTS: [(&str, Value); 23] = [
    ("COM_DISARM_LAND", Value::Real(2.0)),
    ("COM_DISARM_PRFLT", Value::Real(10.0)),
    ("COM_DL_LOSS_T", Value::Int(10)),
    ("COM_LOW_BAT_ACT", Value::Int(0)),
    ("COM_OBL_RC_ACT", Value::Int(0)),
    ("COM_OF_LOSS_T", Value::Real(1.0)),
    ("COM_RCL_EXCEPT", Value::Int(0)),
    ("COM_RC_IN_MODE", Value::Int(1)),
    ("COM_RC_LOSS_T", Value::Real(0.5)),
    ("COM_SPOOLUP_TIME", Value::Real(1.0)),
    ("MAV_COMP_ID", Value::Int(1)),
    ("MAV_SYS_ID", Value::Int(1)),
    ("MIS_TAKEOFF_ALT", Value::Real(2.5)),
    ("MPC_LAND_SPEED", Value::Real(0.7)),
    ("MPC_THR_HOVER", Value::Real(0.5)),
    ("NAV_DLL_ACT", Value::Int(0)),
    ("NAV_RCL_ACT", Value::Int(2)),
    ("RTL_DESCEND_ALT", Value::Real(30.0)),
    ("RTL_LAND_DELAY", Value::Real(0.0)),
    ("RTL_RETURN_ALT", Value::Real(60.0)),
    ("SYS_AUTOCONFIG", Value::Int(0)),
    ("SYS_AUTOSTART", Value::Int(10040)),
    ("THR_MDL_FAC", Value::Real(0.0)),
];

fn names() -> String {
    DEFAULTS.map(|(name, _)| name).join(", ")
}

/// A vehicle's parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Params {
    values: [(&'static str, Value); DEFAULTS.len()],
}

impl Params {
    /// The defaults, with `MAV_SYS_ID` set.
    #[must_use]
    pub fn new(system: u8) -> Self {
        let mut params = Self { values: DEFAULTS };
        if let Some(index) = params.index_of("MAV_SYS_ID") {
            params.set(index, Value::Int(i32::from(system)));
        }
        params
    }

    /// How many there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Never true; here because `len` is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Name and value at an index.
    #[must_use]
    pub fn at(&self, index: usize) -> Option<(&'static str, Value)> {
        self.values.get(index).copied()
    }

    /// Index of a name.
    #[must_use]
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.values.iter().position(|(known, _)| *known == name)
    }

    /// Replaces the value at an index; a value of another type, or one that is not finite, changes
    /// nothing.
    pub fn set(&mut self, index: usize, value: Value) {
        if let Some((_, old)) = self.values.get_mut(index) {
            match (*old, value) {
                (Value::Int(_), Value::Int(_)) => *old = value,
                (Value::Real(_), Value::Real(x)) if x.is_finite() => *old = value,
                _ => {}
            }
        }
    }

    /// Sets a parameter by name, as a configuration file does.
    ///
    /// # Errors
    /// See [`ParamError`].
    pub fn set_by_name(&mut self, name: &str, value: f64) -> Result<(), ParamError> {
        let index = self.index_of(name).ok_or_else(|| ParamError::Unknown(name.into()))?;
        let new = match self.values[index].1 {
            Value::Real(_) => Value::Real(value as f32),
            Value::Int(_) if value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX) => {
                Value::Int(value as i32)
            }
            Value::Int(_) => return Err(ParamError::NotInteger { name: name.into(), value }),
        };
        self.set(index, new);
        Ok(())
    }

    /// A parameter as a number; 0 for a name that does not exist.
    #[must_use]
    pub fn number(&self, name: &str) -> f64 {
        match self.values.iter().find(|(known, _)| *known == name) {
            Some((_, Value::Int(x))) => f64::from(*x),
            Some((_, Value::Real(x))) => f64::from(*x),
            None => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_sorted_unique_and_fit_the_wire() {
        assert!(DEFAULTS.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(DEFAULTS.iter().all(|(name, _)| name.len() <= 16));
    }

    #[test]
    fn integers_travel_as_bit_patterns() {
        for x in [0, 1, 5, -1, 10040, i32::MAX] {
            assert_eq!(Value::Int(0).with_wire(Value::Int(x).to_wire()), Value::Int(x));
        }
    }

    #[test]
    fn bad_overrides_are_refused_by_name() {
        let mut params = Params::new(3);
        assert_eq!(params.number("MAV_SYS_ID"), 3.0);
        assert!(params.set_by_name("COM_OF_LOSS_T", 0.5).is_ok());
        assert_eq!(params.number("COM_OF_LOSS_T"), 0.5);
        assert!(matches!(params.set_by_name("NO_SUCH", 1.0), Err(ParamError::Unknown(_))));
        assert!(matches!(params.set_by_name("COM_OBL_RC_ACT", 0.5), Err(ParamError::NotInteger { .. })));
    }
}

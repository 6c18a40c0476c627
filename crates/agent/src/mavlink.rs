//! The one file that knows NED, FRD and MAVLink: frames of bytes to vehicle messages and back.

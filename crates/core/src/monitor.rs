//! Deviation monitor: the event that triggers a local replan.

//! The display of activities that follow each other, for callbacks, which can't own a [`ProgressDisplay`].

use super::ProgressDisplay;
use std::sync::{Mutex, PoisonError};

/// Shows one activity at a time.
#[derive(Debug, Default)]
pub struct Activities(Mutex<Option<ProgressDisplay>>);

impl Activities {
    /// Shows a new activity headed by `label`.
    pub fn start(&self, label: &str) {
        self.change(|display| *display = Some(ProgressDisplay::new(label)));
    }

    /// Updates the display of the activity, if there is one.
    pub fn update(&self, update: impl FnOnce(&mut ProgressDisplay)) {
        self.change(|display| display.as_mut().map_or((), update));
    }

    /// Removes the display; `outcome` is a detail.
    pub fn end(&self, outcome: Option<&str>) {
        self.change(|display| match (display.take(), outcome) {
            (Some(display), Some(outcome)) => display.finish_in_detail(outcome),
            (Some(display), None) => display.clear(),
            (None, _) => {}
        });
    }

    fn change(&self, change: impl FnOnce(&mut Option<ProgressDisplay>)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

//! Plans a render: what each of its pictures shows, before anything is drawn.
//!
//! ```text
//!  RenderSpec ─┬─► needs ─► (the caller fetches) ─► Captures ─┐
//!  Bodies ─────┘                                              ├─► plan ─► Plan { views, layer, truth, fps }
//!  RenderSpec, Bodies ────────────────────────────────────────┘
//! ```
//!
//! [`plan()`] is a pure function. It knows no network, no files and no tensors: captures come from the caller,
//! and of the models it sees skeletons only. What the pictures look like is up to the renderer.

mod bodies;
mod captures;
mod clip;
mod error;
mod follow;
mod layer;
mod level;
mod light;
mod motion;
mod needs;
mod one_person;
mod orbit;
mod plan;
mod planner;
mod scene;
mod shadow;
mod shot;
mod surroundings;
#[cfg(test)]
mod testing;
mod track;
mod truth;
mod views;

pub use bodies::{Bodies, ModelBodies, Person};
pub use captures::{Capture, Captures};
pub use error::PlanError;
pub use layer::Layer;
pub use needs::{CaptureNeed, needs};
pub use plan::{Actor, Light, MAX_FPS, Plan, View};
pub use planner::plan;
pub use shadow::LIGHT_HEIGHT;
pub use surroundings::Surroundings;
pub use truth::Truth;

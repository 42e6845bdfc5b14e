//! Black-box tests: the real command, service and workers as processes.

mod avatar;
mod bad_input;
mod bad_media;
mod between;
mod containers;
mod engine_workers;
mod erasure;
mod evaluate;
mod export;
mod export_job;
mod fetch;
mod full_disk;
mod joining;
mod keys;
mod main_job;
mod mixed_scene;
mod private;
mod programs;
mod refined_poses;
mod scene;
mod shared_render;
mod subject_export;
mod tour;
mod tradeoff;
mod trees;
mod worker_killed;

//! Checkpoints of the released HumanNeRF program: read, and rendered as that program does.
//!
//! `tests/reference/humannerf_case.py` writes the case in `tests/cases/humannerf/` and the one that
//! `YOTO_HUMANNERF_CASE` names.

mod archive;
mod choices;
mod files;
mod parity;
mod sizes;

use archive::Archive;
use burn::tensor::Device;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use yoto_avatar::import::{HumanNerfOptions, import_humannerf};
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_capture::CaptureView;

/// The committed case: narrow networks, 32 x 32 pixels.
fn case() -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/cases/humannerf")
}

fn checkpoint() -> PathBuf {
    case().join("checkpoint.tar")
}

/// The case's checkpoint after a change.
fn changed(change: impl FnOnce(&mut Archive)) -> (TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("a folder");
    let mut archive = Archive::read(&std::fs::read(checkpoint()).expect("a checkpoint"));
    change(&mut archive);
    let path = dir.path().join("changed.tar");
    std::fs::write(&path, archive.write()).expect("writes");
    (dir, path)
}

/// The folder of an imported model, whose canonical joints are the case's.
fn model(checkpoint: &Path, options: &HumanNerfOptions) -> TempDir {
    let model = tempfile::tempdir().expect("a folder");
    let joints = case().join("canonical_joints.pkl");
    import_humannerf(checkpoint, &joints, model.path(), options).expect("imports");
    model
}

fn load(model: &Path) -> Renderer {
    Renderer::load(model, &Device::flex()).expect("loads")
}

fn render(renderer: &Renderer, capture: &Path, camera: &str) -> Rendered {
    let view = CaptureView::read(capture, camera, 3).expect("a view");
    let skeleton = renderer.skeleton(0).expect("an identity");
    let request = RenderView {
        slot: 0,
        pose: view.pose_for(skeleton),
        camera: view.camera.clone(),
        background: [0.0; 3],
    };
    renderer.render(&request).expect("renders")
}

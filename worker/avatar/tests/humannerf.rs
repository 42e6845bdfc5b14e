//! Checkpoints of the released HumanNeRF program: read, and rendered as that program does.
//!
//! `cases/humannerf/` and what `YOTO_HUMANNERF_CASE` names are written by
//! `tests/reference/humannerf_case.py`.

use burn::tensor::Device;
use safetensors::SafeTensors;
use std::path::{Path, PathBuf};
use yoto_avatar::avatar::{Avatar, PartCount};
use yoto_avatar::config::{ModelConfig, Numerics};
use yoto_avatar::import::{ImportError, import_humannerf};
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_avatar::train::read_parts;
use yoto_capture::CaptureView;

/// Largest difference in rgb and alpha that is allowed on a frame.
const TOLERANCE: f32 = 1e-3;
/// The same in depth, metres: some three metres times that.
const DEPTH_TOLERANCE: f32 = 4e-3;

fn case() -> PathBuf {
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo runs the tests"))
        .join("tests/cases/humannerf")
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let (numbers, _) = bytes.as_chunks::<4>();
    numbers.iter().map(|b| f32::from_le_bytes(*b)).collect()
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

/// Imports the case in `dir`, renders both cameras, and compares with what the script rendered.
fn compare(dir: &Path) {
    let model = tempfile::tempdir().expect("a folder");
    let joints = dir.join("canonical_joints.pkl");
    let imported = import_humannerf(&dir.join("checkpoint.tar"), &joints, model.path());
    let imported = imported.expect("imports");
    assert_eq!(imported.iteration, Some(60_000));
    let parts = read_parts(model.path()).expect("weights");
    let total: u64 = parts.iter().map(|part| part.parameters).sum();
    assert_eq!(total, imported.parameters);
    let renderer = Renderer::load(model.path(), &Device::flex()).expect("loads");
    let bytes = std::fs::read(dir.join("expected.safetensors")).expect("expected frames");
    let expected = SafeTensors::deserialize(&bytes).expect("safetensors");
    for camera in ["train", "cam00"] {
        let frame = render(&renderer, dir, camera);
        for (what, ours, tolerance) in [
            ("rgb", &frame.rgb, TOLERANCE),
            ("alpha", &frame.alpha, TOLERANCE),
            ("depth", &frame.depth, DEPTH_TOLERANCE),
        ] {
            let name = format!("{camera}.{what}");
            let theirs = floats(expected.tensor(&name).expect("a frame").data());
            assert_eq!(theirs.len(), ours.len(), "{name}");
            let largest = theirs.iter().copied().fold(0.0, f32::max);
            assert!(largest > 0.3, "{name} shows nothing");
            let worst = theirs
                .iter()
                .zip(ours)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            println!("{name}: largest difference {worst:e} of {largest}");
            assert!(worst <= tolerance, "{name}: {worst:e}");
        }
    }
}

#[test]
fn a_small_checkpoint_renders_as_the_released_program_does() {
    compare(&case());
}

#[test]
#[ignore = "255 MB: write a case with tests/reference/humannerf_case.py, name it in YOTO_HUMANNERF_CASE"]
fn a_checkpoint_of_full_size_renders_as_the_released_program_does() {
    let dir = std::env::var_os("YOTO_HUMANNERF_CASE").expect("YOTO_HUMANNERF_CASE names a case");
    compare(Path::new(&dir));
}

#[test]
fn numerics_are_a_choice_at_rendering() {
    let (dir, model) = (case(), tempfile::tempdir().expect("a folder"));
    let joints = dir.join("poses.json");
    import_humannerf(&dir.join("checkpoint.tar"), &joints, model.path()).expect("imports");
    let load = || Renderer::load(model.path(), &Device::flex()).expect("loads");
    let reference = render(&load(), &dir, "train");
    let sound = render(&load().with_numerics(Numerics::Sound), &dir, "train");
    let early = render(&load().at_iteration(0), &dir, "train");
    assert!(sound.rgb.iter().all(|v| v.is_finite()));
    assert_ne!(reference.rgb, sound.rgb);
    assert_ne!(
        reference.rgb, early.rgb,
        "closed bands move nothing by pose"
    );
    // Other sample places, the same person.
    let mean = |frame: &Rendered| frame.alpha.iter().sum::<f32>() / frame.alpha.len() as f32;
    assert!((mean(&reference) - mean(&sound)).abs() < 0.2 * mean(&reference));
}

#[test]
fn what_does_not_fit_is_named() {
    let (dir, model) = (case(), tempfile::tempdir().expect("a folder"));
    let (tar, joints) = (dir.join("checkpoint.tar"), dir.join("canonical_joints.pkl"));
    // A checkpoint in which one tensor has another name, and so is missing.
    let mut bytes = std::fs::read(&tar).expect("a checkpoint");
    let name = b"output_linear.0.bias";
    let at = bytes
        .windows(name.len())
        .position(|w| w == name)
        .expect("is there");
    bytes[at] = b'O';
    let broken = model.path().join("broken.tar");
    std::fs::write(&broken, without_checksums(bytes)).expect("writes");
    let error = import_humannerf(&broken, &joints, model.path()).expect_err("a tensor is missing");
    assert!(matches!(error, ImportError::Tensors { .. }), "{error}");
    let told = error.to_string();
    assert!(
        told.contains("cnl_mlp.output_linear.0.bias is missing"),
        "{told}"
    );

    let error = import_humannerf(&joints, &joints, model.path()).expect_err("no checkpoint");
    assert!(
        error.to_string().contains("canonical_joints.pkl"),
        "{error}"
    );
    let error = import_humannerf(&tar, &tar, model.path()).expect_err("no joints");
    assert!(error.to_string().contains("checkpoint.tar"), "{error}");
}

/// A zip whose first entry's checksum is right again after a byte of it was changed.
fn without_checksums(mut bytes: Vec<u8>) -> Vec<u8> {
    let field = |bytes: &[u8], at: usize, size: usize| {
        bytes[at..at + size]
            .iter()
            .rev()
            .fold(0usize, |n, b| n << 8 | usize::from(*b))
    };
    let (name, extra, size) = (
        field(&bytes, 26, 2),
        field(&bytes, 28, 2),
        field(&bytes, 18, 4),
    );
    let start = 30 + name + extra;
    let checksum = crc32(&bytes[start..start + size]).to_le_bytes();
    bytes[14..18].copy_from_slice(&checksum);
    let directory = b"PK\x01\x02";
    let at = bytes
        .windows(4)
        .position(|w| w == directory)
        .expect("a directory");
    bytes[at + 16..at + 20].copy_from_slice(&checksum);
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (0xedb8_8320 & (crc & 1).wrapping_neg())
        })
    })
}

#[test]
fn parts_have_the_published_sizes() {
    let device = Device::flex();
    let count = |variant: &str, people: usize| -> Vec<PartCount> {
        let config = ModelConfig::named("paper", variant).expect("named");
        Avatar::new(&config, people, 24, 0, &device).part_counts()
    };
    let numbers = |parts: &[PartCount]| -> Vec<(String, u64)> {
        parts
            .iter()
            .map(|p| (p.part.clone(), p.parameters))
            .collect()
    };
    let humannerf = count("humannerf", 1);
    assert_eq!(
        numbers(&humannerf),
        [
            ("motion".to_owned(), 63_589_145),
            ("correction".to_owned(), 233_029),
            ("non_rigid".to_owned(), 101_123),
            ("canonical".to_owned(), 494_084),
        ]
    );
    let total = |parts: &[PartCount]| parts.iter().map(|p| p.parameters).sum::<u64>();
    assert_eq!(total(&humannerf), 64_417_381);
    assert!(
        humannerf
            .iter()
            .all(|part| part.bytes == 4 * part.parameters)
    );
    // The paper's six people: 65.3 million there.
    let yoto = count("yoto", 6);
    println!(
        "yoto, six people: {} in all, {:?}",
        total(&yoto),
        numbers(&yoto)
    );
    assert_eq!(total(&yoto), 64_724_325);
}

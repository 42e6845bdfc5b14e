//! Splats on the surface of the shared body: they start on the person, and bones of the surface carry them wherever they are drawn.

use super::splats::view_of;
use crate::support::{options, packed, people, run, tempdir, weights};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::{RenderView, Renderer};
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::skeleton::Skeleton;
use yoto_proto::manifest::files;
use yoto_synthetic::{SyntheticPerson, calm_motion, stress_poses};

const SIZE: u32 = 64;

fn trainer(surface: bool, film: &TrainPerson, steps: u64) -> Trainer {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.surface) = (2000, surface);
    config.refinement.who = Refine::Never;
    Trainer::new(config, options(steps), vec![film.clone()], &Device::flex()).expect("starts")
}

/// PSNR of a training frame, dB.
fn likeness(renderer: &Renderer, film: &TrainPerson, place: usize) -> f64 {
    let frames = film.shard.cropped();
    let truth = frames.image(place);
    let seen = renderer.render(&view_of(film, 0, place)).expect("renders");
    let wanted: Vec<f32> = truth.rgb.iter().map(|v| f32::from(*v) / 255.0).collect();
    psnr(&seen.rgb, &wanted)
}

#[test]
fn a_person_is_recognised_before_the_first_step() {
    let film = &people(&[0], 12, SIZE)[0];
    let started = trainer(true, film, 1).renderer();
    for place in [0, 6] {
        let found = likeness(&started, film, place);
        assert!(found > 19.0, "frame {place}: {found:.1} dB");
    }
}

/// The share of a person in the middle of the picture that `renderer` shows, with legs apart.
fn covered_between_legs(renderer: &Renderer, person: &SyntheticPerson) -> f64 {
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let mut poses = stress_poses(&skeleton).into_iter();
    let wide = poses.find(|it| it.name == "legs-wide").expect("a pose");
    let view = RenderView {
        slot: 0,
        pose: wide.pose,
        camera: SyntheticPerson::train_camera(SIZE),
        background: [0.0; 3],
    };
    let seen = renderer.render(&view).expect("renders");
    let truth = person.render(&view.pose, &view.camera);
    let middle = 7 * seen.width / 16..9 * seen.width / 16;
    let lower_half = seen.height / 2 * seen.width..truth.mask.len();
    let of_person: Vec<usize> = lower_half
        .filter(|i| truth.mask[*i] > 250 && middle.contains(&(i % seen.width)))
        .collect();
    let shown = of_person.iter().filter(|i| seen.alpha[**i] > 0.5).count();
    shown as f64 / of_person.len() as f64
}

#[test]
fn a_skirt_stays_whole_between_legs_that_no_frame_shows_apart() {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let film = person.film(&calm_motion(&skeleton, 24, None), SIZE);
    let film = TrainPerson {
        slot: 0,
        name: person.name().into(),
        shard: Arc::new(packed(film)),
    };
    let mut trained = trainer(true, &film, 30);
    run(&mut trained, 30);
    let covered = covered_between_legs(&trained.renderer(), person);
    assert!(covered > 0.92, "{covered:.2}");
    let notes = trained.notes().concat();
    assert!(notes.contains("as a skirt or a coat does"), "{notes}");
}

#[test]
fn a_checkpoint_has_the_bones_of_the_surface() {
    let film = &people(&[0], 12, SIZE)[0];
    let mut trained = trainer(true, film, 20);
    run(&mut trained, 20);
    let dir = tempdir();
    trained.save(dir.path()).expect("saves");
    let names: Vec<String> = weights(dir.path()).into_keys().collect();
    for name in ["splats.0.bones", "splats.0.bone_weights"] {
        assert!(names.iter().any(|known| known == name), "{name}: {names:?}");
    }
    let loaded = Renderer::load(dir.path(), &Device::flex()).expect("loads");
    let view = view_of(film, 0, 6);
    let [before, after] = [trained.renderer(), loaded].map(|it| it.render(&view).expect("renders"));
    assert_eq!(before.rgb, after.rgb);
    // Players carry splats by the same bones.
    let splats = trained
        .renderer()
        .skinned_splats(0)
        .expect("reads")
        .expect("splats");
    for splat in &splats.splats {
        let sum: f32 = splat.bones.iter().map(|(_, share)| share).sum();
        assert!((sum - 1.0).abs() < 1e-4, "{sum}");
    }
}

#[test]
fn bones_that_the_skeleton_lacks_are_refused() {
    let film = &people(&[0], 12, SIZE)[0];
    let dir = tempdir();
    trainer(true, film, 1).save(dir.path()).expect("saves");
    let path = dir.path().join(files::WEIGHTS);
    let mut bytes = std::fs::read(&path).expect("a file");
    let (length, rest) = bytes.split_first_chunk::<8>().expect("a header");
    let length = u64::from_le_bytes(*length) as usize;
    let header: serde_json::Value = serde_json::from_slice(&rest[..length]).expect("JSON");
    let start = header["splats.0.bones"]["data_offsets"][0].as_u64();
    let start = 8 + length + start.expect("an offset") as usize;
    bytes[start..start + 4].copy_from_slice(&99f32.to_le_bytes());
    std::fs::write(&path, bytes).expect("writes");
    let error = Renderer::load(dir.path(), &Device::flex())
        .err()
        .expect("a wrong bone");
    assert!(error.to_string().contains("splats.0.bones"), "{error}");
}

#[test]
fn training_goes_on_from_a_start_on_the_surface() {
    let film = &people(&[0], 12, SIZE)[0];
    let mut trained = trainer(true, film, 60);
    let before = likeness(&trained.renderer(), film, 3);
    run(&mut trained, 60);
    let after = likeness(&trained.renderer(), film, 3);
    assert!(after > before + 2.0, "{before:.1} dB, then {after:.1} dB");
}

#[test]
fn a_skeleton_that_the_body_lacks_starts_on_the_hull_and_says_so() {
    let mut film = people(&[0], 12, SIZE).remove(0);
    let notes = trainer(true, &film, 1).notes().concat();
    assert!(!notes.contains("joints of SMPL"), "{notes}");
    let mut shard = (*film.shard).clone();
    shard.track.skeleton.names[15] = "skull".into();
    film.shard = std::sync::Arc::new(shard);
    let started = trainer(true, &film, 1);
    let notes = started.notes().concat();
    assert!(notes.contains("24 joints of SMPL"), "{notes}");
    let found = likeness(&started.renderer(), &film, 6);
    assert!(found > 15.0, "{found:.1} dB");
    assert_eq!(trainer(false, &film, 1).notes(), [] as [String; 0]);
}

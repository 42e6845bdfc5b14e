//! People whose skeletons have fingers, in one model with people whose skeletons have none.

use super::splats::view_of;
use crate::support;
use crate::support::{options, run, tempdir};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::render::{Rendered, Renderer};
use yoto_avatar::train::{Learn, ModelState, TrainOptions, TrainPerson, Trainer, refined_track};
use yoto_capture::camera::Camera;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::fingers::with_fingers;
use yoto_capture::skeleton::smpl::{JOINTS, WITH_FINGERS};
use yoto_capture::skeleton::transform::{length, sub};

const SIZE: u32 = 48;

/// The person in `slot`, whose track has fingers that bend during the film.
fn fingered(slot: usize) -> TrainPerson {
    let person = support::people(&[slot], 12, SIZE).remove(0);
    let mut shard = (*person.shard).clone();
    let plain = Skeleton::from_track(&shard.track.skeleton).expect("a skeleton");
    let skeleton = with_fingers(&plain).expect("SMPL's joints");
    shard.track.skeleton = skeleton.to_track();
    for (at, frame) in shard.track.frames.iter_mut().enumerate() {
        let bent = 0.1 * at as f64;
        for joint in JOINTS.len()..WITH_FINGERS {
            let side = if joint < JOINTS.len() + 15 { -1.0 } else { 1.0 };
            frame.pose.extend([0.0, 0.0, side * bent]);
        }
    }
    assert_eq!(shard.track.check(), []);
    TrainPerson {
        shard: Arc::new(shard),
        ..person
    }
}

fn config(refine: Refine) -> ModelConfig {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.coarse) = (2000, 1500);
    config.refinement.who = refine;
    config
}

fn trained(refine: Refine, people: Vec<TrainPerson>, steps: u64) -> Trainer {
    let mut trainer = Trainer::new(config(refine), options(steps), people, &Device::flex())
        .expect("people with and without fingers fit one model");
    run(&mut trainer, steps as usize);
    trainer
}

/// The person in `slot` with fingers bent by an angle, near enough to see them.
fn with_bent(renderer: &Renderer, film: &TrainPerson, angle: f32) -> (Rendered, Camera) {
    let mut view = view_of(film, film.slot, 0);
    for joint in JOINTS.len()..WITH_FINGERS {
        let side = if joint < JOINTS.len() + 15 { -1.0 } else { 1.0 };
        view.pose.rotations[joint] = [0.0, 0.0, side * angle];
    }
    view.camera = view.camera.resized(256, 256);
    (renderer.render(&view).expect("renders"), view.camera)
}

#[test]
fn fingers_move_the_splats_of_hands_and_no_others() {
    let film = fingered(0);
    let plain = support::people(&[1], 12, SIZE).remove(0);
    let trained = trained(Refine::Never, vec![film.clone(), plain], 30);
    let renderer = trained.renderer();
    let splats = |slot| {
        renderer
            .skinned_splats(slot)
            .expect("reads")
            .expect("splats")
    };
    let of_finger = |slot| {
        let splats = splats(slot).splats;
        let is_of_finger = |bone: &(u16, f32)| usize::from(bone.0) >= JOINTS.len() && bone.1 > 0.5;
        splats
            .iter()
            .filter(|it| it.bones.iter().any(is_of_finger))
            .count()
    };
    assert!(of_finger(0) > 5, "{}", of_finger(0));
    assert_eq!(of_finger(1), 0);
    let [(flat, camera), (fist, _)] = [0.0, 1.2].map(|angle| with_bent(&renderer, &film, angle));
    let skeleton = renderer.skeleton(0).expect("a skeleton");
    let joints = skeleton.posed_joints(&view_of(&film, 0, 0).pose);
    let hands = [20, 21].map(|wrist| camera.project(joints[wrist]).expect("in sight"));
    let reach = |wrist: usize| {
        let middle = if wrist == 20 { 29 } else { 44 };
        let [from, to] = [joints[wrist], joints[middle]];
        length(sub(from, to)) * camera.k[0][0] / 2.0
    };
    let mut changed = 0;
    for pixel in 0..256 * 256 {
        let off = (0..3).map(|c| (flat.rgb[3 * pixel + c] - fist.rgb[3 * pixel + c]).abs());
        if off.fold(0.0, f32::max) > 0.02 {
            changed += 1;
            let at = [(pixel % 256) as f64, (pixel / 256) as f64];
            let near = hands.iter().zip([20, 21]);
            let near =
                near.map(|(hand, wrist)| (at[0] - hand[0]).hypot(at[1] - hand[1]) / reach(wrist));
            let nearest = near.fold(f64::INFINITY, f64::min);
            assert!(
                nearest < 2.0,
                "a pixel {nearest:.1} hands away from a wrist"
            );
        }
    }
    assert!(changed > 30, "{changed}");
}

#[test]
fn a_checkpoint_keeps_fingers_and_people_join_it_with_and_without_them() {
    let film = fingered(0);
    let dir = tempdir();
    let trained = trained(Refine::Always, vec![film.clone()], 12);
    trained.save(dir.path()).expect("saves");
    let state = ModelState::read(dir.path()).expect("a state");
    assert_eq!(state.joints, JOINTS.len());
    let skeleton = state.slots[0].as_ref().expect("a skeleton");
    assert_eq!(skeleton.joints(), WITH_FINGERS);
    let loaded = Renderer::load(dir.path(), &Device::flex()).expect("loads");
    let [before, after] = [trained.renderer(), loaded].map(|it| with_bent(&it, &film, 0.7).0);
    assert_eq!(before.rgb, after.rgb);
    for (slot, person) in [
        (1, support::people(&[1], 12, SIZE).remove(0)),
        (1, fingered(1)),
    ] {
        let joining = TrainOptions {
            learn: Learn::Own { slot },
            ..options(6)
        };
        let joined = Trainer::resume(dir.path(), joining, vec![person.clone()], &Device::flex());
        let mut joined = joined.expect("joins");
        run(&mut joined, 6);
        let joints = person.shard.track.joints();
        let renderer = joined.renderer();
        let found = renderer.skeleton(slot).map(Skeleton::joints);
        assert_eq!(found, Some(joints));
        let again = with_bent(&renderer, &film, 0.7).0;
        assert_eq!(again.rgb, before.rgb, "who was there stays as they were");
    }
}

/// A later film of the same person may hide the hands: their fingers stay as they are at rest.
#[test]
fn a_film_without_fingers_continues_a_person_who_has_them() {
    let dir = tempdir();
    let trained = trained(Refine::Never, vec![fingered(0)], 6);
    trained.save(dir.path()).expect("saves");
    let plain = support::people(&[0], 12, SIZE);
    let mut again =
        Trainer::resume(dir.path(), options(6), plain, &Device::flex()).expect("continues");
    run(&mut again, 6);
    let found = again.renderer().skeleton(0).map(Skeleton::joints);
    assert_eq!(found, Some(WITH_FINGERS));
    again.save(dir.path()).expect("saves");
    Renderer::load(dir.path(), &Device::flex()).expect("loads");
}

#[test]
fn poses_with_fingers_are_refined() {
    let film = fingered(0);
    let trained = trained(Refine::Always, vec![film.clone()], 60);
    let dir = tempdir();
    trained.save(dir.path()).expect("saves");
    let refined = refined_track(dir.path(), 0, &film.shard.track).expect("reads");
    let refined = refined.expect("poses were refined");
    assert_eq!(refined.check(), []);
    let moved = |from: usize, to: usize| {
        let pairs = refined.frames.iter().zip(&film.shard.track.frames);
        let off = pairs.map(|(a, b)| {
            let pairs = a.pose[3 * from..3 * to]
                .iter()
                .zip(&b.pose[3 * from..3 * to]);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        });
        off.fold(0.0, f64::max)
    };
    assert!(moved(0, JOINTS.len()) > 1e-4);
    assert!(moved(JOINTS.len(), WITH_FINGERS) > 1e-4);
}

//! People whose skeletons have a face, in one model with people whose skeletons have none.

use super::splats::view_of;
use crate::support;
use crate::support::{options, run, tempdir};
use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::render::Renderer;
use yoto_avatar::train::{TrainPerson, Trainer};
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::parts::with_count;
use yoto_capture::skeleton::smpl::{JOINTS, WITH_FACE, WITH_FINGERS};

const SIZE: u32 = 48;
/// The jaw, which is the first joint of a face.
const JAW: usize = WITH_FINGERS;

/// The person in `slot`, whose skeleton has `count` joints. The mouth, if there is one, opens in the film.
fn person(slot: usize, count: usize) -> TrainPerson {
    let person = support::people(&[slot], 12, SIZE).remove(0);
    let mut shard = (*person.shard).clone();
    let plain = Skeleton::from_track(&shard.track.skeleton).expect("a skeleton");
    let skeleton = with_count(&plain, count).expect("SMPL's joints");
    shard.track.skeleton = skeleton.to_track();
    for (at, frame) in shard.track.frames.iter_mut().enumerate() {
        frame.pose.resize(3 * count, 0.0);
        if count == WITH_FACE {
            frame.pose[3 * JAW] = 0.02 * at as f64;
        }
    }
    assert_eq!(shard.track.check(), []);
    TrainPerson {
        shard: Arc::new(shard),
        ..person
    }
}

fn trained(people: Vec<TrainPerson>, steps: u64) -> Trainer {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    (splats.count, splats.coarse) = (2000, 1500);
    config.refinement.who = Refine::Never;
    let mut trainer =
        Trainer::new(config, options(steps), people, &Device::flex()).expect("one model");
    run(&mut trainer, steps as usize);
    trainer
}

/// The person in slot 0 with the jaw open by an angle, from where the film's camera is.
fn with_open(renderer: &Renderer, film: &TrainPerson, angle: f32) -> Vec<f32> {
    let mut view = view_of(film, 0, 0);
    view.pose.rotations[JAW] = [angle, 0.0, 0.0];
    view.camera = view.camera.resized(256, 256);
    renderer.render(&view).expect("renders").rgb
}

#[test]
fn a_jaw_moves_the_splats_of_the_face_and_no_others() {
    let film = person(0, WITH_FACE);
    let others = [person(1, WITH_FINGERS), person(2, JOINTS.len())];
    let trained = trained([vec![film.clone()], others.to_vec()].concat(), 12);
    let renderer = trained.renderer();
    let of_face = |slot| {
        let splats = renderer.skinned_splats(slot).expect("reads");
        let is_of_face = |bone: &(u16, f32)| usize::from(bone.0) >= WITH_FINGERS && bone.1 > 0.5;
        let splats = splats.expect("splats").splats;
        let own = splats.iter().filter(|it| it.bones.iter().any(is_of_face));
        own.count()
    };
    assert!(of_face(0) > 5, "{}", of_face(0));
    assert_eq!([of_face(1), of_face(2)], [0, 0]);
    let [closed, open] = [0.0, 0.5].map(|angle| with_open(&renderer, &film, angle));
    let skeleton = renderer.skeleton(0).expect("a skeleton");
    let view = view_of(&film, 0, 0);
    let camera = view.camera.resized(256, 256);
    let joints = skeleton.posed_joints(&view.pose);
    let [head, neck] = [15, 12].map(|joint| camera.project(joints[joint]).expect("in sight"));
    let reach = 2.0 * (head[0] - neck[0]).hypot(head[1] - neck[1]);
    let mut changed = 0;
    for pixel in 0..256 * 256 {
        let off = (0..3).map(|c| (closed[3 * pixel + c] - open[3 * pixel + c]).abs());
        if off.fold(0.0, f32::max) > 0.02 {
            changed += 1;
            let at = [(pixel % 256) as f64, (pixel / 256) as f64];
            let away = (at[0] - head[0]).hypot(at[1] - head[1]);
            assert!(
                away < reach,
                "a pixel {away:.0} of {reach:.0} pixels from the head"
            );
        }
    }
    assert!(changed > 10, "{changed}");
}

/// A later film of the same person may hide the face, or hands too: they stay as they are at rest.
#[test]
fn a_film_without_a_face_continues_a_person_who_has_one() {
    let dir = tempdir();
    let film = person(0, WITH_FACE);
    let first = trained(vec![film.clone()], 6);
    first.save(dir.path()).expect("saves");
    let loaded = Renderer::load(dir.path(), &Device::flex()).expect("loads");
    let [before, after] = [first.renderer(), loaded].map(|it| with_open(&it, &film, 0.4));
    assert_eq!(before, after);
    for count in [JOINTS.len(), WITH_FINGERS] {
        let people = vec![person(0, count)];
        let again = Trainer::resume(dir.path(), options(12), people, &Device::flex());
        let mut again = again.expect("continues");
        run(&mut again, 6);
        let found = again.renderer().skeleton(0).map(Skeleton::joints);
        assert_eq!(found, Some(WITH_FACE));
    }
    // Somebody with fingers alone gets no face from a film that shows one: their splats have no place on it.
    let dir = tempdir();
    let fingered = trained(vec![person(0, WITH_FINGERS)], 6);
    fingered.save(dir.path()).expect("saves");
    let again = Trainer::resume(dir.path(), options(12), vec![film], &Device::flex());
    let mut again = again.expect("continues");
    run(&mut again, 6);
    again.save(dir.path()).expect("saves");
    Renderer::load(dir.path(), &Device::flex()).expect("loads");
}

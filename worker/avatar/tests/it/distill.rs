//! Splats that learn a person from a field's pictures.

use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::distill::{
    CaptureFrame, DistillError, DistillStage, FEWEST, StudentTraining, Teacher,
};
use yoto_avatar::train::{Budget, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::camera::Pose;
use yoto_capture::check::jumps;
use yoto_capture::{Shard, ShardBuilder};
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 64;

fn trained(tier: &str, shard: Arc<Shard>, steps: u64, validation: Validation) -> Trainer {
    let config = ModelConfig::named(tier, "yoto").expect("a tier");
    let options = TrainOptions {
        budget: Budget::Steps(steps),
        validation,
        ..TrainOptions::default()
    };
    let person = TrainPerson {
        slot: 0,
        name: "ada".into(),
        shard,
    };
    let mut trainer = Trainer::new(config, options, vec![person], &Device::flex()).expect("starts");
    while !trainer.finished() {
        trainer.step().expect("a step");
    }
    trainer
}

#[test]
fn splats_show_what_a_field_shows() {
    let actor = &SyntheticPerson::cast(1, 7)[0];
    let (track, images) = actor.capture(12, SIZE);
    let poses: Vec<Pose> = track
        .frames
        .iter()
        .map(|frame| Pose::from_frame(frame).expect("a pose"))
        .collect();
    let mut shard = ShardBuilder::new(track);
    for image in &images {
        shard.push(image).expect("fits");
    }
    let shard = Arc::new(shard.finish().expect("complete"));
    let capture_frames = CaptureFrame::of(&shard, &poses, SIZE).expect("cameras");
    let small = CaptureFrame::of(&shard, &poses, SIZE / 2).expect("cameras");
    assert_eq!(small[1].camera.width, SIZE / 2);
    assert_eq!(small[1].image.width, SIZE as usize / 2);
    let field = trained("draft", shard, 150, Validation::NONE).renderer();
    let teacher = |poses, slot| Teacher {
        renderer: &field,
        slot,
        poses,
        up: [0.0, 1.0, 0.0],
        size: [SIZE; 2],
        capture_frames: &[],
    };
    let film = teacher(&poses, 0)
        .render_shard(|pictures| pictures < 24, &mut || true)
        .expect("a film");
    assert_eq!(film.frames(), 24);
    assert!(jumps(&film.track).expect("a skeleton").len() > 1);
    for frame in 0..film.frames() {
        let image = film.image(frame);
        let shown = image.mask.iter().filter(|alpha| **alpha > 127).count();
        assert!(
            shown > 150,
            "picture {frame} shows {shown} pixels of the person"
        );
        // Nobody reaches the edge: the camera sees the whole body.
        let side = SIZE as usize;
        let edge =
            (0..side).flat_map(|i| [i, (side - 1) * side + i, i * side, i * side + side - 1]);
        let cut = edge.filter(|at| image.mask[*at] > 127).count();
        assert_eq!(cut, 0, "picture {frame}");
    }
    let mut splats = trained("splat", Arc::new(film), 200, Validation::Every(6));
    splats.validate().expect("pictures");
    let likeness = splats.progress().psnr.expect("held-out pictures");
    assert!(likeness > 24.0, "{likeness} dB to the field");

    // The field was drawn in these very poses, however the body jumps from one picture to the next: none is refined.
    let both = Teacher {
        capture_frames: &capture_frames,
        ..teacher(&poses, 0)
    };
    let training = StudentTraining {
        name: "ada".into(),
        seconds: 1.0,
        seed: 7,
        scratch: None,
    };
    let mut done = Vec::new();
    let mut tell = |_: DistillStage, share: f64| done.push(share);
    let made = training.run(&both, &Device::flex(), &mut tell, &mut || true);
    let made = made.expect("splats");
    assert!(made.pictures >= FEWEST + 12, "{} pictures", made.pictures);
    let notes = made.trainer.progress().notes;
    assert!(
        !notes.iter().any(|it| it.contains("poses are refined")),
        "{notes:?}"
    );
    assert!(
        done.is_sorted() && done.last().is_some_and(|it| *it > 0.9),
        "{done:?}"
    );

    // What was filmed follows, in its own poses and from its own cameras.
    let both = both.render_shard(|pictures| pictures < 2, &mut || true);
    let both = both.expect("pictures");
    assert_eq!(both.frames(), 2 + 12);
    for (place, (image, pose)) in images.iter().zip(&poses).enumerate() {
        assert_eq!(both.image(2 + place).rgb, image.rgb);
        let frame = &both.track.frames[2 + place];
        assert_eq!(frame.e, capture_frames[place].camera.e);
        assert_eq!(Pose::from_frame(frame).expect("a pose"), *pose);
    }

    assert!(matches!(
        teacher(&[], 0).render_shard(|_| false, &mut || true),
        Err(DistillError::NoPoses)
    ));
    assert!(matches!(
        teacher(&poses, 3).render_shard(|_| false, &mut || true),
        Err(DistillError::NoSuchSlot(3))
    ));
}

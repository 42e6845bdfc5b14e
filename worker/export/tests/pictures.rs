//! Exported people look the same as in the renderer.

use burn::tensor::Device;
use std::sync::Arc;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::decoder::Prior;
use yoto_avatar::evaluate::metrics::psnr;
use yoto_avatar::render::{RenderView, SkinnedSplats};
use yoto_avatar::train::{Budget, Learn, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::transform::IDENTITY;
use yoto_export::gaussians::posed;
use yoto_export::mesh::MeshOptions;
use yoto_export::order::{ExportError, Exported, Order};
use yoto_formats::splats::Gaussian;
use yoto_ops::splat::cpu::SplatSlices;
use yoto_ops::splat::harmonics::terms;
use yoto_ops::splat::{View, render};
use yoto_proto::v1::ExportForm;
use yoto_synthetic::SyntheticPerson;

const SIZE: u32 = 96;
const STEPS: u64 = 40;

/// A training of one synthetic person, with its light and motion weights on the way.
fn trainer() -> (Trainer, TrainPerson) {
    let made_up = &SyntheticPerson::cast(1, 7)[0];
    let (track, images) = made_up.capture(12, SIZE);
    let mut builder = ShardBuilder::new(track);
    for image in &images {
        builder.push(image).expect("a synthetic frame is valid");
    }
    let person = TrainPerson {
        slot: 0,
        name: made_up.name().into(),
        shard: Arc::new(builder.finish().expect("all frames are there")),
    };
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let splats = config.appearance.splats_mut().expect("splats");
    splats.count = 2000;
    // Fast enough to be visible after a few steps.
    (splats.harmonics, splats.harmonic_rate) = (2, 2e-2);
    config.refinement.who = Refine::Never;
    let options = TrainOptions {
        scratch: None,
        refine_poses: None,
        exposure: None,
        harmonics: None,
        leave_unseen: false,
        prior: Prior::People,
        learn: Learn::Everything,
        budget: Budget::Steps(STEPS),
        used_seconds: 0.0,
        used_steps: 0,
        seed: 11,
        image_size: 0,
        validation: Validation::NONE,
        lpips: None,
    };
    let people = vec![person.clone()];
    let mut trainer = Trainer::new(config, options, people, &Device::flex()).expect("starts");
    for _ in 0..STEPS {
        trainer.step().expect("a step");
    }
    (trainer, person)
}

/// The picture of Gaussians without bones and light.
fn picture(splats: &[Gaussian], camera: &Camera) -> Vec<f32> {
    let whole = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let eye = camera.centre();
    let row = |splat: &Gaussian| {
        let view: [f32; 3] = std::array::from_fn(|a| splat.mean[a] - eye[a] as f32);
        let length = view.iter().map(|v| v * v).sum::<f32>().sqrt();
        let terms = terms(view.map(|v| v / length));
        let gained = |c: usize| -> f32 {
            (splat.harmonics.iter().zip(&terms))
                .map(|(own, term)| own[c] * term)
                .sum()
        };
        let mut row = splat.mean.to_vec();
        row.extend(splat.rotation);
        row.extend(splat.deviations.map(f32::ln));
        row.push((splat.opacity / (1.0 - splat.opacity)).ln());
        row.extend((0..3).map(|c| splat.colour[c] + gained(c)));
        row
    };
    let rows: Vec<f32> = splats.iter().flat_map(row).collect();
    let narrow = |row: &[f64]| -> [f32; 3] { std::array::from_fn(|c| row[c] as f32) };
    let body_view = View {
        width: camera.width as usize,
        height: camera.height as usize,
        k: [narrow(&camera.k[0]), narrow(&camera.k[1])],
        e: std::array::from_fn(|r| camera.e[r].map(|v| v as f32)),
        world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    };
    let numbers = SplatSlices {
        transforms: &whole.repeat(splats.len()),
        rows: &rows,
        light: &[0.0; 24],
    };
    render(&[(numbers, &body_view)]).expect("somebody").rgb
}

#[test]
fn exported_gaussians_draw_the_renderer_s_picture() {
    let (trainer, person) = trainer();
    let renderer = trainer.renderer();
    let exported = renderer.skinned_splats(0).expect("reads").expect("splats");
    assert!(exported.splats.len() > 1000, "{}", exported.splats.len());
    let track = &person.shard.track;
    for index in [0, 7] {
        let frame = &track.frames[index];
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let splats = posed(&exported, &pose, &IDENTITY).expect("a pose of hers");
        let view = RenderView {
            slot: 0,
            pose,
            camera: camera.clone(),
            background: [0.0; 3],
        };
        let rendered = renderer.render(&view).expect("renders").rgb;
        let drawn: Vec<f32> = picture(&splats, &camera)
            .iter()
            .map(|value| value.clamp(0.0, 1.0))
            .collect();
        // Four bones in place of all, and colours within what a screen shows.
        let alike = psnr(&drawn, &rendered);
        assert!(alike > 40.0, "frame {index}: {alike:.1} dB");
        // A viewer without view-dependent colours shows another picture.
        let plain: Vec<Gaussian> = (splats.iter())
            .map(|splat| Gaussian {
                harmonics: [[0.0; 3]; 8],
                ..*splat
            })
            .collect();
        let plain = psnr(&picture(&plain, &camera), &rendered);
        assert!(plain < alike - 3.0, "frame {index}: {plain:.1} dB without");
        // A picture of the wrong pose is far from it.
        let other = Pose::from_frame(&track.frames[index + 3]).expect("a pose");
        let other = posed(&exported, &other, &IDENTITY).expect("a pose of hers");
        assert!(psnr(&picture(&other, &camera), &rendered) < alike - 10.0);
    }
    assert!(renderer.skinned_splats(1).is_err(), "nobody is there");
}

/// Mean squared difference of `person` to `whole` over frames of their capture.
fn error(person: &SkinnedSplats, whole: &SkinnedSplats, film: &TrainPerson) -> f64 {
    let track = &film.shard.track;
    let frames = [0, 3, 7, 10].map(|index| &track.frames[index]);
    let errors = frames.map(|frame| {
        let pose = Pose::from_frame(frame).expect("a pose");
        let camera = Camera::from_frame(frame, track.image_size).expect("a camera");
        let of = |splats| picture(&posed(splats, &pose, &IDENTITY).expect("a pose"), &camera);
        let (found, wanted) = (of(person), of(whole));
        let squares = found
            .iter()
            .zip(&wanted)
            .map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>() / found.len() as f64
    });
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn fewer_splats_stand_for_all() {
    let (trainer, film) = trainer();
    let whole = trainer
        .renderer()
        .skinned_splats(0)
        .expect("reads")
        .expect("splats");
    let all = whole.splats.len();
    assert_eq!(whole.reduced_to(all), whole);
    let mut before = 0.0;
    for share in [2, 4, 8] {
        let fewer = whole.reduced_to(all / share);
        assert_eq!(fewer.splats.len(), all / share);
        // Every `share`-th of the splats, whose order says nothing about where they are.
        let mut dropped = whole.clone();
        let kept = dropped.splats.iter().step_by(share);
        dropped.splats = kept.copied().collect();
        if let Some(shapes) = &mut dropped.shapes {
            let own = shapes.weights.chunks(shapes.count).step_by(share);
            shapes.weights = own.flatten().copied().collect();
        }
        let [merged, dropped] = [&fewer, &dropped].map(|it| error(it, &whole, &film));
        assert!(
            merged < 0.3 * dropped,
            "1/{share}: {merged:e} and {dropped:e}"
        );
        assert!(merged > before, "1/{share}: {merged:e} after {before:e}");
        before = merged;
        assert_eq!(whole.reduced_to(all / share), fewer, "there is one way");
    }
}

#[test]
fn files_have_the_most_bytes_that_they_may_have() {
    let (trainer, _) = trainer();
    let person = trainer
        .renderer()
        .skinned_splats(0)
        .expect("reads")
        .expect("splats");
    let write = |form, max_bytes| -> Result<Exported, ExportError> {
        let order = Order {
            form,
            title: "Ada",
            stem: "ada",
            motions: &[],
            frame: None,
            mesh: MeshOptions::default(),
            rights: "",
            max_bytes,
        };
        order.of(&person)
    };
    let forms = [
        ExportForm::Page,
        ExportForm::SplatsPly,
        ExportForm::SplatsSpz,
        ExportForm::SplatsGlb,
    ];
    for form in forms {
        let whole = write(form, None).expect("writes");
        let bytes = whole.files[0].bytes.len() as u64;
        let as_it_is = write(form, Some(bytes)).expect("writes");
        assert_eq!(as_it_is.files[0].bytes, whole.files[0].bytes);
        let least = match write(form, Some(1000)) {
            Err(ExportError::TooFewBytes { max: 1000, least }) => least,
            Ok(_) => 1000,
            Err(other) => panic!("{form:?}: {other}"),
        };
        for max in [least + (bytes - least) / 2, least + (bytes - least) / 5] {
            let fewer = write(form, Some(max)).expect("writes");
            let bytes = fewer.files[0].bytes.len() as u64;
            assert!(
                bytes <= max && 5 * bytes >= 4 * max,
                "{form:?}: {bytes} of {max}"
            );
            assert!(fewer.splats < whole.splats, "{form:?}");
        }
    }
}

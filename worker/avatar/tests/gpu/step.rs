//! Training steps and frames of the smallest tier and of splats, on the Vulkan device and on the CPU.

use crate::compare::{relative_error, values};
use crate::device::on_vulkan;
use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::sync::Arc;
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::{ModelConfig, Refine};
use yoto_avatar::decoder::Prior;
use yoto_avatar::loss::PatchObjective;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::render::{RenderView, Rendered, Renderer};
use yoto_avatar::train::batch::{Batch, Scene, outcome};
use yoto_avatar::train::{Budget, Learn, TrainOptions, TrainPerson, Trainer, Validation};
use yoto_capture::ShardBuilder;
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_synthetic::SyntheticPerson;

/// Seconds a training step or a frame may take on a software driver, which compiles its kernels first.
const LIMIT: u64 = 300;
/// Side of the image, pixels.
const SIDE: u32 = 16;

/// The smallest tier, with all scheduled parts active from the first step.
fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    // The bounds below were measured on colours alone.
    config.optimise.mask_weight = 0.0;
    config.schedule = config.schedule.all_at_once();
    config.optimise.patches = 1;
    config.optimise.patch_size = SIDE;
    config
}

fn person() -> TrainPerson {
    let person = &SyntheticPerson::cast(1, 7)[0];
    let (track, images) = person.capture(6, 2 * SIDE);
    let mut builder = ShardBuilder::new(track);
    for image in &images {
        builder.push(image).expect("a synthetic frame is valid");
    }
    TrainPerson {
        slot: 0,
        name: person.name().into(),
        shard: Arc::new(builder.finish().expect("all frames are there")),
    }
}

/// Gradients of all parameters that have one, by path.
struct Collect<'a> {
    grads: &'a GradientsParams,
    path: Vec<String>,
    found: BTreeMap<String, Vec<f32>>,
}

impl ModuleVisitor for Collect<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if let Some(grad) = self.grads.get::<D>(param.id) {
            self.found.insert(self.path.join("."), values(grad));
        }
    }
}

/// A person, their pose, and a patch with its ground truth.
struct Sitting {
    skeleton: Skeleton,
    pose: Pose,
    camera: Camera,
    truth: Vec<f32>,
}

impl Sitting {
    fn new() -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let person = &SyntheticPerson::cast(1, 7)[0];
        Self {
            skeleton: Skeleton::from_track(&person.skeleton()).expect("a skeleton"),
            pose: person.motion(6)[1].clone(),
            camera: SyntheticPerson::train_camera(SIDE),
            truth: (0..SIDE * SIDE * 3).map(|_| rng.random()).collect(),
        }
    }

    /// The loss and the gradient of each parameter.
    fn gradients(&self, device: &Device) -> (f32, BTreeMap<String, Vec<f32>>) {
        let device = device.clone().autodiff();
        let config = config();
        let joints = self.skeleton.joints();
        let avatar = Avatar::new(&config, 1, joints, 5, &device);
        let body = CanonicalBody::new(self.skeleton.clone(), &config, &device);
        let body_view = BodyView::new(&body.skeleton, &self.pose, &self.camera);
        let side = SIDE as usize;
        let batch = Batch {
            rays: (0..side * side)
                .map(|i| body_view.ray((i % side) as f64 + 0.5, (i / side) as f64 + 0.5))
                .collect(),
            patch_size: side,
            truth: self.truth.clone(),
            coverage: vec![1.0; side * side],
            background: [0.2, 0.5, 0.9],
        };
        let scene = Scene {
            config: &config,
            body: &body,
            slot: 0,
            pose: &self.pose,
            schedule_progress: 1.0,
            step: 10,
            occupancy: None,
        };
        let objective =
            PatchObjective::without_lpips(config.optimise.ssim_weight, batch.patch_size, &device);
        let outcome = outcome(&avatar, &scene, &batch, &objective, None)
            .expect("a device that works")
            .expect("rays that meet the body");
        let loss = values(outcome.loss.clone())[0];
        let grads = GradientsParams::from_grads(outcome.loss.backward(), &avatar);
        let mut collect = Collect {
            grads: &grads,
            path: Vec::new(),
            found: BTreeMap::new(),
        };
        avatar.visit(&mut collect);
        (loss, collect.found)
    }
}

#[test]
fn a_training_steps_loss_and_gradients_are_the_cpus() {
    on_vulkan(LIMIT, |vulkan| {
        let sitting = Sitting::new();
        let (loss, ours) = sitting.gradients(&vulkan);
        let (expected, reference) = sitting.gradients(&Device::flex());
        println!("loss: {loss} for {expected}");
        assert!((loss - expected).abs() < 1e-5 * expected.abs());
        assert!(ours.keys().eq(reference.keys()));
        let mut far = Vec::new();
        for (path, reference) in &reference {
            // The search for a canonical point ends a few units in the last place elsewhere, which
            // the shares of table entries magnify by the number of cells.
            let is_table = path.starts_with("canonical.shared") || path.contains(".tables.");
            let bound = if is_table { 3e-4 } else { 1e-4 };
            let ours = &ours[path];
            if reference.iter().all(|g| *g == 0.0) {
                assert!(ours.iter().all(|g| *g == 0.0), "{path}");
                continue;
            }
            let error = relative_error(ours, reference);
            let largest = reference.iter().fold(0f32, |m, g| m.max(g.abs()));
            println!("{path}: {error:e} of {largest:e}");
            if error >= bound || error.is_nan() {
                far.push(path);
            }
        }
        assert!(far.is_empty(), "too far from the CPU's: {far:?}");
    });
}

/// A training after some steps, on exact poses.
fn trained(config: ModelConfig, steps: u64, device: &Device) -> Trainer {
    let options = TrainOptions {
        scratch: None,
        budget: Budget::Steps(steps),
        used_seconds: 0.0,
        used_steps: 0,
        seed: 11,
        image_size: 0,
        validation: Validation::Every(steps as usize),
        refine_poses: Some(Refine::Never),
        exposure: None,
        harmonics: None,
        leave_unseen: false,
        prior: Prior::People,
        learn: Learn::Everything,
        lpips: None,
    };
    let mut trainer = Trainer::new(config, options, vec![person()], device).expect("starts");
    for _ in 0..steps {
        trainer.step().expect("a step");
    }
    trainer
}

/// Asserts that a training goes the same way on both devices, and that its checkpoint of the Vulkan
/// device renders the same on both. Returns what the two trainings show.
fn assert_trains_and_renders_alike(
    config: &ModelConfig,
    steps: u64,
    vulkan: &Device,
) -> [Rendered; 2] {
    let ours = trained(config.clone(), steps, vulkan);
    let reference = trained(config.clone(), steps, &Device::flex());
    let (loss, expected) = (ours.progress().loss, reference.progress().loss);
    println!("loss: {loss} for {expected}");
    assert!((loss - expected).abs() < 1e-3 * expected.abs());
    assert_eq!(ours.progress().skipped_steps, 0);

    let dir = tempfile::tempdir().expect("a folder");
    ours.save(dir.path()).expect("saves");
    let view = RenderView {
        slot: 0,
        pose: SyntheticPerson::cast(1, 7)[0].motion(6)[0].clone(),
        camera: SyntheticPerson::train_camera(2 * SIDE),
        background: [0.1, 0.2, 0.3],
    };
    let render = |device: &Device| {
        let renderer = Renderer::load(dir.path(), device).expect("loads");
        renderer.render(&view).expect("renders")
    };
    assert_same_picture(&render(vulkan), &render(&Device::flex()), 1e-4);
    [ours, reference].map(|trainer| trainer.renderer().render(&view).expect("renders"))
}

fn assert_same_picture(ours: &Rendered, reference: &Rendered, bound: f32) {
    assert!(
        reference.alpha.iter().any(|a| *a > 0.01),
        "somebody is seen"
    );
    for (part, a, b) in [
        ("rgb", &ours.rgb, &reference.rgb),
        ("alpha", &ours.alpha, &reference.alpha),
        ("depth", &ours.depth, &reference.depth),
    ] {
        let error = relative_error(a, b);
        println!("{part}: {error:e}");
        assert!(error < bound, "{part}: {error:e}");
    }
}

#[test]
fn a_training_goes_the_cpus_way_and_its_checkpoint_renders_the_same() {
    on_vulkan(LIMIT, |vulkan| {
        assert_trains_and_renders_alike(&config(), 3, &vulkan);
    });
}

#[test]
fn a_training_of_splats_goes_the_cpus_way_and_its_checkpoint_renders_the_same() {
    on_vulkan(LIMIT, |vulkan| {
        let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
        let splats = config.appearance.splats_mut().expect("splats");
        (splats.count, splats.harmonics) = (600, 2);
        splats.surface = false;
        // Whether a frame shows a splat is decided by thresholds, which the last bits of its place can cross.
        splats.guess_unseen = false;
        let [ours, reference] = assert_trains_and_renders_alike(&config, 12, &vulkan);
        assert_same_picture(&ours, &reference, 1e-4);
        let splats = config.appearance.splats_mut().expect("splats");
        splats.surface = true;
        let [ours, reference] = assert_trains_and_renders_alike(&config, 12, &vulkan);
        // Adam divides by the size of a gradient, and factors of bones that hardly carry a point have gradients of rounding errors.
        assert_same_picture(&ours, &reference, 2e-3);
    });
}

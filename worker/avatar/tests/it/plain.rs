//! With no samples left out, the loss equals that of the plain form: every sample is warped and
//! evaluated, and composited by Burn's tensor operations.

use burn::module::{Module, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use rand_chacha::ChaCha8Rng;
use yoto_avatar::avatar::{Avatar, AvatarAppearance};
use yoto_avatar::config::ModelConfig;
use yoto_avatar::loss::{Objective, PatchObjective, Patches};
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::render::march::{Volume, march};
use yoto_avatar::train::batch::{Batch, Scene, outcome};
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;
use yoto_ops::composite::{RaySamples, reference};
use yoto_synthetic::SyntheticPerson;

const SIDE: usize = 40;
const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

fn config() -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    let field = config.appearance.field_mut().expect("a field");
    field.march.epsilon = 0.0;
    field.march.min_transmittance = 0.0;
    field.march.occupancy_cells = 0;
    // The plain form compares colours only.
    config.optimise.mask_weight = 0.0;
    config
}

fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.try_into_vec_as().expect("f32")
}

/// A person and a camera.
struct Look {
    skeleton: Skeleton,
    pose: Pose,
    camera: Camera,
}

impl Look {
    fn new() -> Self {
        let person = &SyntheticPerson::cast(1, 7)[0];
        let (track, _) = person.capture(1, SIDE as u32);
        Self {
            skeleton: Skeleton::from_track(&track.skeleton).expect("a skeleton"),
            pose: person.unseen_motion(4)[2].clone(),
            camera: SyntheticPerson::train_camera(SIDE as u32),
        }
    }

    fn batch(&self, body: &CanonicalBody) -> Batch {
        let body_view = BodyView::new(&body.skeleton, &self.pose, &self.camera);
        let pixel = |i: usize| body_view.ray((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5);
        Batch {
            rays: (0..SIDE * SIDE).map(pixel).collect(),
            patch_size: SIDE,
            truth: vec![0.4; 3 * SIDE * SIDE],
            coverage: vec![1.0; SIDE * SIDE],
            background: BACKGROUND,
        }
    }
}

/// Colours over the background `[1, R, 3]`, in the plain form.
fn plain(avatar: &Avatar, config: &ModelConfig, body: &CanonicalBody, look: &Look) -> Tensor<3> {
    let posed = avatar.pose(config, body, 0, &look.pose, 1.0);
    let batch = look.batch(body);
    let (weights, transforms) = (
        values(posed.weights.clone()),
        values(posed.transforms.clone()),
    );
    let volume = Volume {
        weights: &weights,
        transforms: &transforms,
        grid: &body.grid,
        unposing: config.motion.unposing,
        occupancy: None,
        step: None,
    };
    let samples = march(
        &batch.rays,
        config.appearance.march().expect("rays"),
        None::<&mut ChaCha8Rng>,
        &volume,
    )
    .all();
    let hits = batch.rays.iter().flatten().count();
    assert_eq!(
        samples.live(),
        hits * config.appearance.march().expect("rays").samples,
        "all samples"
    );
    let device = posed.weights.device();
    let points = TensorData::new(samples.points.clone(), [samples.live(), 3]);
    let points = Tensor::from_data(points, &device);
    let near = TensorData::new(samples.canonical.clone(), [samples.live(), 3]);
    let near = Some(Tensor::from_data(near, &device));
    let AvatarAppearance::Field(field) = avatar.appearance(config) else {
        panic!("the tier has a field");
    };
    let (fields, _, likelihood) = field.evaluate(body, &posed, points, near);
    let along = RaySamples {
        starts: samples.starts().into(),
        steps: samples.steps.as_slice().into(),
        depths: samples.depths.as_slice().into(),
        min_transmittance: 0.0,
        subsampling: None,
    };
    let seen = reference::composite(fields.rgb, fields.density, likelihood, &along);
    let rays = batch.rays.len();
    let clear = seen.clone().slice([0..rays, 3..4]).neg() + 1.0;
    let background = Tensor::<1>::from_floats(BACKGROUND, &device).unsqueeze::<2>();
    (seen.slice([0..rays, 0..3]) + clear * background).unsqueeze::<3>()
}

struct Collect<'a> {
    grads: &'a GradientsParams,
    found: Vec<Vec<f32>>,
}

impl ModuleVisitor for Collect<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let grad = self.grads.get::<D>(param.id).map(values);
        self.found.push(grad.unwrap_or_default());
    }
}

fn gradients(avatar: &Avatar, loss: Tensor<1>) -> Vec<Vec<f32>> {
    let grads = GradientsParams::from_grads(loss.backward(), avatar);
    let mut collect = Collect {
        grads: &grads,
        found: Vec::new(),
    };
    avatar.visit(&mut collect);
    collect.found
}

#[test]
fn a_loss_and_its_gradients() {
    let (config, look) = (config(), Look::new());
    let device = Device::flex().autodiff();
    let body = CanonicalBody::new(look.skeleton.clone(), &config, &device);
    let avatar = Avatar::new(&config, 1, look.skeleton.parents.len(), 5, &device);
    let objective = PatchObjective::without_lpips(0.02, SIDE, &device);
    let scene = Scene {
        config: &config,
        body: &body,
        slot: 0,
        pose: &look.pose,
        // All scheduled parts are active.
        schedule_progress: 1.0,
        step: 0,
        occupancy: None,
    };
    let batch = look.batch(&body);
    let ours = outcome(&avatar, &scene, &batch, &objective, None)
        .expect("a device that works")
        .expect("rays that meet the body");
    let truth = TensorData::new(batch.truth.clone(), [1, SIDE * SIDE, 3]);
    let truth = Tensor::from_data(truth, &device);
    let expected = objective.loss(Patches {
        predicted: plain(&avatar, &config, &body, &look),
        truth,
        side: SIDE,
    });
    let expected = expected.expect("terms");
    let number = |loss: &Tensor<1>| loss.clone().into_scalar::<f32>();
    let difference = (number(&ours.loss) - number(&expected)).abs();
    assert!(
        difference <= 1e-6 * number(&expected),
        "loss differs by {difference:e}"
    );
    let (ours, expected) = (gradients(&avatar, ours.loss), gradients(&avatar, expected));
    let mut compared = 0;
    for (ours, expected) in ours.iter().zip(&expected) {
        assert_eq!(ours.len(), expected.len());
        let largest = expected.iter().fold(0f32, |m, g| m.max(g.abs()));
        if largest < 1e-9 {
            continue;
        }
        for (a, b) in ours.iter().zip(expected) {
            assert!((a - b).abs() <= 1e-4 * largest, "{a:e} {b:e}");
        }
        compared += 1;
    }
    assert!(compared > 10, "only {compared} parameters with gradients");
}

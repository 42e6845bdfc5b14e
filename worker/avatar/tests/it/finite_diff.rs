//! Gradients against finite differences: for each group of parameters, the change of the loss along
//! a direction is compared with the one that the gradient predicts. The loss is the trainer's, of
//! fixed rays.
//!
//! Directions are sums of the gradient, so that the loss changes by more than its rounding errors,
//! and of random numbers, so that missing parts of a gradient are found.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use yoto_avatar::avatar::Avatar;
use yoto_avatar::config::{Encoding, LayersConfig, ModelConfig, Resolution, Unposing};
use yoto_avatar::loss::PatchObjective;
use yoto_avatar::motion::body::CanonicalBody;
use yoto_avatar::train::batch::{Batch, Outcome, Scene, outcome};
use yoto_capture::body_box::BodyView;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;

/// Directions per group.
const DIRECTIONS: usize = 3;
/// Predicted change of the loss by the longest move. Short moves suffer from rounding, long ones
/// from the curvature of the loss and the corners of ReLUs.
const CHANGE: f64 = 3e-6;
/// Number of moves per slope, over which rounding errors average out.
const MOVES: usize = 16;
/// Relative error allowed.
const BOUND: f64 = 5e-3;
/// Standard deviation of random numbers added to parameters, many of which start at 0 and would
/// have little influence.
const SPREAD: f32 = 0.2;
/// The same for motion weights that searches go through.
const SMOOTH: f32 = 0.02;
/// Subtracted from the logits of the background, so that rays meet something in the coarse grid.
const LESS_BACKGROUND: f32 = 9.0;
/// Number of joints of the skeleton.
const JOINTS: usize = 4;
/// Side of the one patch, pixels.
const SIDE: usize = 16;

type ByPath = BTreeMap<String, Vec<f32>>;

/// Gradients of all parameters that have one, by path.
struct Collect<'a> {
    grads: &'a GradientsParams,
    path: Vec<String>,
    found: ByPath,
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
            let values = grad.try_into_vec_as().expect("f32");
            self.found.insert(self.path.join("."), values);
        }
    }
}

/// Adds numbers to parameters.
struct Move<F: FnMut(&str, usize) -> Option<Vec<f32>>> {
    path: Vec<String>,
    by: F,
}

impl<F: FnMut(&str, usize) -> Option<Vec<f32>>> ModuleMapper for Move<F> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.into());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let shape = param.val().shape();
        let Some(by) = (self.by)(&self.path.join("."), shape.num_elements()) else {
            return param;
        };
        param.map(|tensor| {
            let by = Tensor::<D>::from_data(TensorData::new(by, shape), &tensor.device());
            let moved = tensor.clone().detach() + by;
            if tensor.is_require_grad() {
                moved.detach().require_grad()
            } else {
                moved
            }
        })
    }
}

fn moved(avatar: Avatar, by: impl FnMut(&str, usize) -> Option<Vec<f32>>) -> Avatar {
    avatar.map(&mut Move {
        path: Vec::new(),
        by,
    })
}

fn normal(rng: &mut ChaCha8Rng) -> f32 {
    // The sum of twelve uniform numbers has a variance of 1.
    (0..12).map(|_| rng.random::<f32>()).sum::<f32>() - 6.0
}

fn skeleton() -> Skeleton {
    Skeleton {
        names: ["pelvis", "spine", "head", "l_hip"]
            .map(String::from)
            .to_vec(),
        parents: vec![None, Some(0), Some(1), Some(0)],
        rest: vec![
            [0.0, 0.9, 0.0],
            [0.0, 1.2, 0.02],
            [0.03, 1.45, 0.0],
            [0.1, 0.6, 0.0],
        ],
    }
}

fn config(encoding: Encoding, unposing: Unposing) -> ModelConfig {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    let layers = LayersConfig {
        width: 16,
        depth: 4,
        skip: Some(2),
        inject: 1,
    };
    config.code_width = 8;
    config.motion.resolution = 9.into();
    config.motion.unposing = unposing;
    if unposing == Unposing::Inverse {
        config.motion.resolution = Resolution::Axes([9, 8, 10]);
        config.motion.own = Some(Resolution::Axes([5, 4, 10]));
        config.optimise.mask_weight = 0.3;
    }
    config.correction.width = 12;
    config.schedule = config.schedule.all_at_once();
    config.non_rigid.layers = layers.clone();
    config.non_rigid.bands = 2;
    let field = config.appearance.field_mut().expect("a field");
    field.canonical.layers = layers;
    field.canonical.encoding = encoding;
    field.canonical.density_scale = 5.0;
    field.march.samples = 16;
    // All samples are evaluated, since a move could change which ones are left out.
    field.march.epsilon = 0.0;
    field.march.min_transmittance = 0.0;
    config.check().expect("a possible model");
    config
}

/// One model, one body, one patch.
struct Bench {
    config: ModelConfig,
    pose: Pose,
    batch: Batch,
}

impl Bench {
    fn new(encoding: Encoding, unposing: Unposing, rng: &mut ChaCha8Rng) -> Self {
        let config = config(encoding, unposing);
        let mut draw = || std::array::from_fn(|_| 0.3 * normal(rng));
        let pose = Pose {
            rotations: (0..JOINTS).map(|_| draw()).collect(),
            translation: draw(),
        };
        let body = CanonicalBody::new(skeleton(), &config, &Device::flex());
        let at = pose.translation.map(f64::from);
        let target = [at[0], at[1] + 1.0, at[2]];
        let eye = [at[0] + 0.4, at[1] + 1.2, at[2] + 2.5];
        let (side, up) = (SIDE as u32, [0.0, 1.0, 0.0]);
        let camera = Camera::look_at(eye, target, up, 2.0 * SIDE as f64, side, side);
        let body_view = BodyView::new(&body.skeleton, &pose, &camera);
        let batch = Batch {
            rays: (0..SIDE * SIDE)
                .map(|i| body_view.ray((i % SIDE) as f64 + 0.5, (i / SIDE) as f64 + 0.5))
                .collect(),
            patch_size: SIDE,
            truth: (0..SIDE * SIDE * 3).map(|_| rng.random()).collect(),
            coverage: (0..SIDE * SIDE).map(|i| (i % 11) as f32 / 10.0).collect(),
            background: rng.random(),
        };
        Self {
            config,
            pose,
            batch,
        }
    }

    fn outcome(&self, avatar: &Avatar, device: &Device) -> Outcome {
        let body = CanonicalBody::new(skeleton(), &self.config, device);
        let scene = Scene {
            config: &self.config,
            body: &body,
            slot: 0,
            pose: &self.pose,
            schedule_progress: 1.0,
            step: 10,
            occupancy: None,
        };
        let objective = PatchObjective::without_lpips(0.0, SIDE, device);
        outcome(avatar, &scene, &self.batch, &objective, None)
            .expect("a device that works")
            .expect("rays that meet the body")
    }

    /// The loss, with its mean in double precision: in single precision, the sum over thousands of
    /// pixels would lose the change of a short move.
    fn loss(&self, avatar: &Avatar) -> f64 {
        let seen = self.outcome(avatar, &Device::flex()).seen;
        let rgb: Vec<f32> = seen.rgb.try_into_vec_as().expect("f32");
        let alpha: Vec<f32> = seen.alpha.try_into_vec_as().expect("f32");
        let squares = self
            .batch
            .truth
            .iter()
            .zip(rgb)
            .enumerate()
            .map(|(i, (truth, rgb))| {
                let clear = 1.0 - f64::from(alpha[i / 3]);
                let background = f64::from(self.batch.background[i % 3]);
                (f64::from(rgb) + clear * background - f64::from(*truth)).powi(2)
            });
        let masked = self.batch.coverage.iter().zip(&alpha).map(|(mask, alpha)| {
            let (mask, alpha) = (f64::from(*mask), f64::from(*alpha));
            (2.0 * mask - 1.0).abs() * (alpha - mask).powi(2)
        });
        let mean = |sum: f64, count: usize| sum / count as f64;
        mean(squares.sum(), self.batch.truth.len())
            + self.config.optimise.mask_weight * mean(masked.sum(), self.batch.coverage.len())
    }
}

/// A direction of length 1 over the group's parameters.
fn direction(gradient: &ByPath, rng: &mut ChaCha8Rng) -> ByPath {
    let all = || gradient.values().flatten();
    let count = all().count() as f32;
    let length = all().map(|g| g * g).sum::<f32>().sqrt();
    let mixed: ByPath = gradient
        .iter()
        .map(|(path, g)| {
            let mix = |g: &f32| g / length + normal(rng) / count.sqrt();
            (path.clone(), g.iter().map(mix).collect())
        })
        .collect();
    let length = mixed.values().flatten().map(|v| v * v).sum::<f32>().sqrt();
    let unit = |values: Vec<f32>| values.into_iter().map(|v| v / length).collect();
    mixed.into_iter().map(|(path, v)| (path, unit(v))).collect()
}

fn dot(a: &ByPath, b: &ByPath) -> f64 {
    let pairs = a.values().flatten().zip(b.values().flatten());
    pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
}

/// The slope of the loss along `direction`, from a linear and a cubic term fitted to the central
/// differences over several lengths.
fn slope(bench: &Bench, avatar: &Avatar, direction: &ByPath, longest: f32) -> f64 {
    let at = |length: f32| {
        let step = |path: &str, _| {
            let values = direction.get(path)?;
            Some(values.iter().map(|v| v * length).collect())
        };
        bench.loss(&moved(avatar.clone(), step))
    };
    // Least squares of half the difference = slope · h + c · h³, h in units of the longest.
    let (mut hh, mut hc, mut cc, mut hy, mut cy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for step in 1..=MOVES {
        let h = step as f64 / MOVES as f64;
        let length = longest * h as f32;
        let (y, c) = ((at(length) - at(-length)) / 2.0, h.powi(3));
        hh += h * h;
        hc += h * c;
        cc += c * c;
        hy += h * y;
        cy += c * y;
    }
    (hy * cc - cy * hc) / (hh * cc - hc * hc) / f64::from(longest)
}

fn groups_agree(encoding: Encoding, unposing: Unposing, groups: &[&str]) {
    let mut rng = ChaCha8Rng::seed_from_u64(17);
    let bench = Bench::new(encoding, unposing, &mut rng);
    let device = Device::flex().autodiff();
    let avatar = moved(
        Avatar::new(&bench.config, 2, JOINTS, 5, &device),
        |path, count| {
            // Where weights are rough, searches fail, here and there, with a move.
            let rough = unposing == Unposing::Blend || !path.starts_with("motion");
            let spread = if rough { SPREAD } else { SMOOTH };
            let mut by: Vec<f32> = (0..count).map(|_| spread * normal(&mut rng)).collect();
            if path == "motion.base" {
                by[JOINTS * count / (JOINTS + 1)..].fill(-LESS_BACKGROUND);
            }
            Some(by)
        },
    );
    let outcome = bench.outcome(&avatar, &device);
    let loss = f64::from(outcome.loss.clone().into_scalar::<f32>());
    assert!(
        (bench.loss(&avatar.valid()) / loss - 1.0).abs() < 1e-6,
        "one loss"
    );
    let grads = GradientsParams::from_grads(outcome.loss.backward(), &avatar);
    let mut collect = Collect {
        grads: &grads,
        path: Vec::new(),
        found: ByPath::new(),
    };
    avatar.visit(&mut collect);
    let still = avatar.valid();
    for group in groups {
        let gradient: ByPath = collect
            .found
            .iter()
            .filter(|(path, _)| path.starts_with(group))
            .map(|(path, values)| (path.clone(), values.clone()))
            .collect();
        for _ in 0..DIRECTIONS {
            let direction = direction(&gradient, &mut rng);
            let analytic = dot(&gradient, &direction);
            assert!(analytic.abs() > 1e-7, "{group}: the loss hangs on it");
            let longest = (CHANGE / analytic.abs()) as f32;
            let error = (slope(&bench, &still, &direction, longest) / analytic - 1.0).abs();
            println!("\n| {group} | {analytic:.1e} | {error:.1e} |");
            assert!(error <= BOUND, "{group}: relative error {error:.2e}");
        }
    }
}

/// The groups that every model has.
const GROUPS: [&str; 7] = [
    "codes.0",
    "motion.base",
    "motion.residuals.0",
    "correction.",
    "condition.",
    "non_rigid.",
    "canonical.mlp",
];

#[test]
fn every_group_of_a_model_with_bands() {
    groups_agree(Encoding::Fourier { bands: 3 }, Unposing::Blend, &GROUPS);
}

/// A small grid.
const GRID: Encoding = Encoding::Hash {
    levels: 2,
    base: 2,
    growth: 2.0,
    log2_rows: 6,
    features: 4,
    own_log2_rows: 5,
};

#[test]
fn every_group_of_a_model_with_tables() {
    let tables = ["canonical.tables.0", "canonical.shared"];
    let groups: Vec<&str> = GROUPS.into_iter().chain(tables).collect();
    groups_agree(GRID, Unposing::Blend, &groups);
}

#[test]
fn motion_through_inverse_skinning() {
    let groups = [
        "motion.base",
        "motion.residuals.0",
        "correction.",
        "canonical.tables.0",
    ];
    groups_agree(GRID, Unposing::Inverse, &groups);
}

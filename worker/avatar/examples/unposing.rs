//! How far from the skin each way back to the canonical pose ends (docs/quality.md), for a capture
//! folder or, without one, a synthetic person:
//!
//!     cargo run --release -p yoto-avatar --example unposing -- CAPTURE
//!
//! The weights of the prior are taken as true. Canonical points near bones are skinned forward into
//! ten poses by linear blend skinning, and brought back by the blend of the paper's eq. 1, and by
//! searches of one to [`STEPS`] steps from there.

use burn::tensor::{Device, Tensor, TensorData};
use rand::{RngExt, SeedableRng};
use std::error::Error;
use yoto_avatar::config::ModelConfig;
use yoto_avatar::motion::body::Body;
use yoto_avatar::motion::posed;
use yoto_capture::CaptureFolder;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::warp::inverse::{STEPS, unpose};
use yoto_ops::warp::warp;
use yoto_synthetic::SyntheticPerson;

/// Poses, evenly over the motion.
const POSES: usize = 10;
/// Canonical points per pose.
const POINTS: usize = 4000;
/// Sums of the prior's weights between which a point counts as on the skin or near it.
const NEAR_SKIN: std::ops::Range<f32> = 0.2..0.9;
/// Reported shares of the points.
const QUANTILES: [f64; 4] = [0.5, 0.75, 0.9, 0.97];

fn main() -> Result<(), Box<dyn Error>> {
    let (skeleton, poses) = person(std::env::args().nth(1))?;
    let config = ModelConfig::named("balanced", "yoto")?;
    let device = Device::flex();
    let body = Body::new(skeleton, &config, &device);
    // The prior itself, without the background.
    let bones = body.skeleton.joints();
    let weights = body.log_prior.clone().exp().narrow(0, 0, bones);
    let canonical = points_near_skin(&body, &weights)?;
    let ways = 1 + STEPS;
    let mut errors = vec![Vec::new(); ways];
    for pose in poses
        .iter()
        .step_by((poses.len() / POSES).max(1))
        .take(POSES)
    {
        let transforms = posed::transforms(&body, pose);
        let posed = skinned(&weights, &transforms, &canonical, &body)?;
        let [n, _] = posed.dims();
        let blend = warp(
            weights.clone(),
            transforms.clone(),
            posed.clone(),
            &body.grid,
        );
        let blend = blend.slice([0..n, 0..3]);
        for (steps, errors) in errors.iter_mut().enumerate() {
            let found = match steps {
                0 => blend.clone(),
                _ => unpose(
                    weights.clone(),
                    transforms.clone(),
                    posed.clone(),
                    blend.clone(),
                    blend.clone(),
                    &body.grid,
                    steps,
                ),
            };
            errors.extend(distances(found, &canonical)?);
        }
    }
    println!("millimetres from the skin: {QUANTILES:?} of the points");
    for (steps, errors) in errors.iter_mut().enumerate() {
        errors.sort_by(f32::total_cmp);
        let at = |q: f64| 1e3 * errors[(q * (errors.len() - 1) as f64) as usize];
        println!("{steps} steps: {:.1?}", QUANTILES.map(at));
    }
    Ok(())
}

/// The skeleton and the poses of a capture folder, or of a synthetic person.
fn person(capture: Option<String>) -> Result<(Skeleton, Vec<Pose>), Box<dyn Error>> {
    let Some(dir) = capture else {
        let actor = &SyntheticPerson::cast(1, 7)[0];
        return Ok((Skeleton::from_track(&actor.skeleton())?, actor.motion(100)));
    };
    let folder = CaptureFolder::open(dir)?;
    let track = folder.track();
    let poses: Result<Vec<Pose>, _> = track.frames.iter().map(Pose::from_frame).collect();
    Ok((Skeleton::from_track(&track.skeleton)?, poses?))
}

/// Random points of the canonical box `[N, 3]` where the sum of the weights is in [`NEAR_SKIN`].
fn points_near_skin(body: &Body, weights: &Tensor<2>) -> Result<Tensor<2>, Box<dyn Error>> {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut points: Vec<f32> = Vec::new();
    while points.len() < 3 * POINTS {
        let some: Vec<f32> = (0..POINTS)
            .flat_map(|_| {
                std::array::from_fn::<f32, 3, _>(|a| {
                    rng.random_range(body.grid.min[a]..body.grid.max[a])
                })
            })
            .collect();
        let sums = shares(weights, &tensor(some.clone()), body)?;
        for (at, weights) in some.as_chunks::<3>().0.iter().zip(sums) {
            if NEAR_SKIN.contains(&weights.iter().sum()) {
                points.extend(at);
            }
        }
    }
    points.truncate(3 * POINTS);
    Ok(tensor(points))
}

/// The weight of each bone at each of the canonical `points` `[N, 3]`.
fn shares(
    weights: &Tensor<2>,
    points: &Tensor<2>,
    body: &Body,
) -> Result<Vec<Vec<f32>>, Box<dyn Error>> {
    let ([bones, _], [n, _]) = (weights.dims(), points.dims());
    let still = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.];
    let still = Tensor::<2>::from_floats([still], &points.device());
    let mut shares = vec![vec![0.0; bones]; n];
    for bone in 0..bones {
        let volume = weights.clone().narrow(0, bone, 1);
        let alone = warp(volume, still.clone(), points.clone(), &body.grid);
        let column: Vec<f32> = alone.slice([0..n, 3..4]).try_into_vec_as()?;
        for (shares, weight) in shares.iter_mut().zip(column) {
            shares[bone] = weight;
        }
    }
    Ok(shares)
}

/// The `canonical` points `[N, 3]` as linear blend skinning carries them; `transforms` `[K, 12]` lead
/// the other way.
fn skinned(
    weights: &Tensor<2>,
    transforms: &Tensor<2>,
    canonical: &Tensor<2>,
    body: &Body,
) -> Result<Tensor<2>, Box<dyn Error>> {
    let shares = shares(weights, canonical, body)?;
    let transforms: Vec<f32> = transforms.clone().try_into_vec_as()?;
    let points: Vec<f32> = canonical.clone().try_into_vec_as()?;
    let mut posed = Vec::with_capacity(points.len());
    for (at, shares) in points.as_chunks::<3>().0.iter().zip(shares) {
        let sum: f32 = shares.iter().sum();
        let mut to = [0f32; 3];
        for (bone, share) in transforms.as_chunks::<12>().0.iter().zip(shares) {
            for (a, to) in to.iter_mut().enumerate() {
                // Rᵀ (c − t).
                let turned: f32 = (0..3)
                    .map(|b| bone[4 * b + a] * (at[b] - bone[4 * b + 3]))
                    .sum();
                *to += share / sum * turned;
            }
        }
        posed.extend(to);
    }
    Ok(tensor(posed))
}

/// Distances between points `[N, 3]`, metres.
fn distances(found: Tensor<2>, truth: &Tensor<2>) -> Result<Vec<f32>, Box<dyn Error>> {
    let apart = (found - truth.clone()).powi_scalar(2).sum_dim(1).sqrt();
    Ok(apart.try_into_vec_as()?)
}

/// `[N, 3]`.
fn tensor(points: Vec<f32>) -> Tensor<2> {
    let n = points.len() / 3;
    Tensor::from_data(TensorData::new(points, [n, 3]), &Device::flex())
}

use super::*;
use crate::avatar::{Avatar, AvatarAppearance};
use crate::config::{ModelConfig, Unposing};
use crate::fit::test_scene::TestScene;
use crate::fit::{CHANNELS, PixelGrid, truth};
use burn::module::Module;
use yoto_capture::skeleton::transform::{apply, compose, compose_axis_angle, rigid, rodrigues};
use yoto_ops::warp::cpu::forward;
use yoto_ops::warp::inverse::solve::Skinning;

/// Rays of the untrained model, their gradients by [`rays`], and what they show after a small
/// change of one number of the pose.
#[test]
fn rays_change_as_the_jacobian_says() {
    rays_change_by(Unposing::Blend);
}

#[test]
fn rays_change_as_the_jacobian_says_through_inverse_skinning() {
    rays_change_by(Unposing::Inverse);
}

fn rays_change_by(unposing: Unposing) {
    let mut config = ModelConfig::named("draft", "yoto").expect("a tier");
    config.motion.unposing = unposing;
    // No sample comes or goes with the change.
    let field = config.appearance.field_mut().expect("a field");
    field.march.epsilon = 0.0;
    field.march.occupancy_cells = 0;
    let scene = TestScene::new(config, 48);
    let (config, body, image) = (&scene.config, &scene.body, &scene.image);
    let (pose, picture, covered) = (&scene.pose, scene.picture(), &scene.covered);
    let joints = body.skeleton.joints();
    let avatar = Avatar::new(config, 1, joints, 5, &scene.device).no_grad();
    let AvatarAppearance::Field(field) = avatar.appearance(config) else {
        panic!("the tier has a field");
    };
    let fitter = scene.fitter(&avatar);
    let grid = PixelGrid::new(image, covered, 0.2, [0.0; 2]).expect("a person");
    let posed = avatar.pose(config, body, 0, pose, 0.0);
    let host = HostPose::new(body, pose, &posed).expect("reads");
    let mut samples = fitter.samples(field, pose, &picture, &grid.pixels, &host);
    assert!(truth(image, covered[0] as usize, CHANNELS[0]) > 0.0);

    let width = 3 * (joints + 1);
    let size = 1e-3;
    for weights in CHANNELS.map(|weights| vec![weights; samples.rays]) {
        let (_, to_warped) = fitter
            .gradients(field, &posed, &samples, &weights)
            .expect("renders");
        let jacobian = rays(body, &host, unposing, &samples, to_warped);
        let largest = jacobian.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let (mut off, mut all) = (0.0, 0.0);
        for parameter in (0..width).step_by(5).chain(width - 3..width) {
            let mut shown = [-size, size].map(|by| {
                let mut changed = pose.clone();
                let (joint, axis) = (parameter / 3, parameter % 3);
                let mut moved = samples.points.clone();
                let mut rotation = [0.0; 3];
                rotation[axis] = by;
                if joint > 0 && joint < joints {
                    let given = changed.rotations[joint].map(f64::from);
                    changed.rotations[joint] =
                        compose_axis_angle(given, rotation).map(|v| v as f32);
                } else {
                    // The root moves the points the other way: Rᵀ (x − j − s) + j.
                    let root = body.skeleton.root();
                    let back = if joint == 0 {
                        let there = rigid(rodrigues(rotation.map(|v| -v)), root);
                        compose(&there, &rigid(rodrigues([0.0; 3]), root.map(|v| -v)))
                    } else {
                        rigid(rodrigues([0.0; 3]), rotation.map(|v| -v))
                    };
                    for point in moved.as_chunks_mut::<3>().0 {
                        *point = apply(&back, point.map(f64::from)).map(|v| v as f32);
                    }
                }
                let transforms = crate::motion::posed::transforms(body, &changed);
                let transforms = read(transforms).expect("reads");
                let warped = forward(&host.weights, &transforms, &moved, &body.grid);
                let (warped, _) = warped.as_chunks::<4>();
                let skinning = Skinning::new(&host.weights, &transforms, &body.grid);
                let places = moved.as_chunks::<3>().0.iter().zip(warped);
                let canonical = places.map(|(x, w)| {
                    let blend = [w[0], w[1], w[2]];
                    match unposing {
                        Unposing::Blend => blend,
                        Unposing::Inverse => skinning.search(*x, blend).unwrap_or(blend),
                    }
                });
                samples.canonical = canonical.flatten().collect();
                samples.likelihoods = warped.iter().map(|w| w[3]).collect();
                fitter
                    .gradients(field, &posed, &samples, &weights)
                    .expect("renders")
                    .0
            });
            let [less, more] = &mut shown;
            for (ray, row) in jacobian.chunks_exact(width).enumerate() {
                let slope = f64::from(more[ray] - less[ray]) / (2.0 * size);
                off += (slope - row[parameter]).powi(2);
                all += slope * slope;
            }
        }
        let relative = (off / all).sqrt();
        assert!(
            relative < 0.05 && largest > 1e-3,
            "{relative} off, up to {largest}"
        );
    }
}

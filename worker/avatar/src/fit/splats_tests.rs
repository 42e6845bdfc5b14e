use super::*;
use crate::avatar::{Avatar, AvatarAppearance};
use crate::config::ModelConfig;
use crate::field::splats::SplatValues;
use crate::fit::test_scene::TestScene;
use crate::fit::{CHANNELS, PixelGrid, PoseChange};
use burn::module::Module;
use burn::tensor::Tensor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::splat::render;

/// Splats of any rotation, scale and colour, around the bones.
fn around(skeleton: &Skeleton, count: usize) -> SplatValues {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut any = |low: f32, high: f32| rng.random_range(low..high);
    let joints = skeleton.rest.iter().cycle().take(count);
    let mut first = SplatValues::at_origin(0);
    for joint in joints {
        first.means.extend(joint.map(|v| v as f32 + any(-0.1, 0.1)));
        first.rotations.extend([(); 4].map(|()| any(-1.0, 1.0)));
        first.scales.extend([(); 3].map(|()| any(-4.0, -2.5)));
        first.opacities.push(any(-2.0, 3.0));
        first.colours.extend([(); 3].map(|()| any(0.1, 0.9)));
    }
    first
}

#[test]
fn pixels_change_as_the_jacobian_says() {
    let mut config = ModelConfig::named("splat", "yoto").expect("a tier");
    let count = 400;
    config.appearance.splats_mut().expect("splats").count = count;
    let scene = TestScene::new(config, 64);
    let (config, body, device) = (&scene.config, &scene.body, &scene.device);
    let (pose, picture) = (&scene.pose, scene.picture());
    let joints = body.skeleton.joints();
    let mut avatar = Avatar::new(config, 1, joints, 5, device);
    avatar.place_splats(0, &around(&body.skeleton, count));
    let light = Tensor::<2>::from_floats([[0.2, -0.1, 0.3, 0.1, 0.0, 0.2, -0.2, 0.1]; 3], device);
    avatar.splats[0].light = burn::module::Param::from_tensor(light);
    let avatar = avatar.no_grad();
    let AvatarAppearance::Splats(splats_of) = avatar.appearance(config) else {
        panic!("the tier has splats");
    };
    let fitter = scene.fitter(&avatar);
    let grid = PixelGrid::new(&scene.image, &scene.covered, 0.05, [0.0; 2]).expect("a person");
    let width = 3 * (joints + 1);
    let size = 1e-3;
    for by in CHANNELS {
        let (posed, _) = fitter.posed(pose).expect("poses");
        let weights = vec![by; grid.pixels.len()];
        let shown = fitter
            .splat_pixels_with_jacobian(splats_of, pose, &picture, &grid.pixels, &weights)
            .expect("reads")
            .expect("somebody");
        let at = |pose: &Pose| -> Vec<f32> {
            let seen = fitter.splat_pixels(splats_of, pose, &picture, &grid.pixels);
            let seen = seen.expect("reads").expect("somebody");
            let sums = seen.iter().map(|it| (0..4).map(|c| it[c] * by[c]).sum());
            sums.collect()
        };
        let splats = splats_of.posed_splats(body, &posed).expect("read");
        let view = body_view(&body.skeleton, pose, &scene.camera);
        let splats = HostSplats::read(splats, &view).expect("reads");
        let drawn = render(&[(splats.as_slices(), &view)]).expect("somebody");
        let drawn = grid.pixels.iter().map(|p| {
            let colour: f32 = (0..3).map(|c| by[c] * drawn.rgb[3 * p + c]).sum();
            colour + by[3] * drawn.alpha[*p]
        });
        // Tiles stop at pixels that are not quite opaque.
        assert!(drawn.zip(&shown.values).all(|(a, b)| (a - b).abs() < 2e-3));
        let same = at(pose).into_iter().zip(&shown.values);
        assert!(same.into_iter().all(|(a, b)| (a - b).abs() < 1e-5));
        for parameter in 0..width {
            let [less, more] = [-size, size].map(|by| {
                let mut step = vec![0.0; width];
                step[parameter] = by;
                let mut change = PoseChange::none(joints);
                change.take(&step, 1.0);
                at(&change.of(pose))
            });
            let slopes = more.iter().zip(&less);
            let slopes = slopes.map(|(more, less)| f64::from(more - less) / (2.0 * size));
            let rows = shown.jacobian.chunks_exact(width).map(|row| row[parameter]);
            // Pixels that the joint moves.
            let pairs: Vec<(f64, f64)> = slopes.zip(rows).filter(|it| it.1 != 0.0).collect();
            let squares: f64 = pairs.iter().map(|(slope, _)| slope * slope).sum();
            let usual = (squares / pairs.len() as f64).sqrt();
            // Pictures jump where two splats change their order, and where one is cut off.
            let far = pairs.iter().filter(|(a, b)| (a - b).abs() > 0.1 * usual);
            let far = far.count() as f64 / pairs.len() as f64;
            assert!(
                far < 0.1 && usual > 1e-3,
                "{parameter}: {far} are off by 0.1 of {usual}"
            );
        }
    }
}

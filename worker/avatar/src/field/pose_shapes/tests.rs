use super::*;
use crate::config::ModelConfig;
use burn::tensor::Device;
use yoto_capture::skeleton::Skeleton;
use yoto_synthetic::SyntheticPerson;

struct ShapedPerson {
    config: ModelConfig,
    shapes: PoseShapes,
    body: CanonicalBody,
    means: Vec<f32>,
    poses: Vec<Pose>,
}

/// A person whose shapes are random, with splats around the joints.
fn person() -> ShapedPerson {
    let device = Device::flex();
    let config = ModelConfig::named("splat", "yoto").expect("a tier");
    let person = &SyntheticPerson::cast(1, 7)[0];
    let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
    let joints = skeleton.joints();
    let init = Initial::new(&device, 3);
    let mut shapes = PoseShapes::new(&init, &config, joints, 2, 0).expect("shapes");
    let size = shapes.basis.val().dims();
    shapes.basis = init.normal("basis", size, 0.05);
    shapes.own[1] = init.normal("own", size, 0.05);
    let near = |[x, y, z]: &[f64; 3]| [*x as f32 + 0.05, *y as f32 - 0.04, *z as f32];
    let means = skeleton.rest.iter().flat_map(near).collect();
    ShapedPerson {
        body: CanonicalBody::new(skeleton, &config, &device),
        shapes,
        means,
        poses: person.unseen_motion(6),
        config,
    }
}

impl ShapedPerson {
    fn offsets(&self, slot: usize, pose: &Pose) -> Vec<f32> {
        let config = self.config.pose_shapes().expect("shapes");
        let means = TensorData::new(self.means.clone(), [self.means.len() / 3, 3]);
        let means = Tensor::from_data(means, &Device::flex());
        let found = (self.shapes).offsets(config, slot, &self.body, &means, pose, None);
        read(found.expect("read")).expect("read")
    }
}

fn largest(offsets: &[f32]) -> f32 {
    offsets.iter().fold(0.0, |most, v| most.max(v.abs()))
}

#[test]
fn nothing_moves_at_rest_or_by_turning_the_whole_person() {
    let mut person = person();
    let device = Device::flex();
    let init = Initial::new(&device, 0);
    let poses = person.poses.clone();
    (person.shapes.record_pose_range(&init, 0, poses.iter())).expect("read");
    let mut pose = Pose::rest(person.body.rest.len());
    assert_eq!(largest(&person.offsets(0, &pose)), 0.0);
    pose.rotations[0] = [0.3, 2.0, -0.4];
    pose.translation = [1.0, 2.0, 3.0];
    assert_eq!(largest(&person.offsets(0, &pose)), 0.0);
    assert!(largest(&person.offsets(0, &person.poses[1])) > 1e-3);
}

#[test]
fn offsets_go_on_beyond_filmed_poses_and_stay_at_the_limits() {
    let mut person = person();
    let device = Device::flex();
    let init = Initial::new(&device, 0);
    let elbow = |angle: f32| {
        let mut pose = Pose::rest(person.body.rest.len());
        pose.rotations[18] = [0.0, 0.0, angle];
        pose
    };
    let bent: Vec<Pose> = [0.0, 0.2, 0.4, 0.6, 1.4, 1.5].map(elbow).to_vec();
    assert_eq!(
        largest(&person.offsets(0, &bent[1])),
        0.0,
        "nothing was filmed"
    );
    (person.shapes.record_pose_range(&init, 0, bent[..2].iter())).expect("read");
    let moved: Vec<_> = bent.iter().map(|pose| person.offsets(0, pose)).collect();
    assert!(largest(&moved[1]) > 1e-4);
    assert_ne!(moved[2], moved[3]);
    // Sine and cosine are beyond their limits.
    assert_eq!(moved[4], moved[5]);
    // A second film adds to the first.
    (person.shapes.record_pose_range(&init, 0, bent[4..].iter())).expect("read");
    assert_eq!(person.offsets(0, &bent[1]), moved[1]);
    assert_ne!(person.offsets(0, &bent[4]), moved[4]);
}

#[test]
fn people_share_shapes_and_have_their_own() {
    let mut person = person();
    let device = Device::flex();
    let init = Initial::new(&device, 0);
    let poses = person.poses.clone();
    for slot in [0, 1] {
        (person.shapes.record_pose_range(&init, slot, poses.iter())).expect("read");
    }
    let [one, other] = [0, 1].map(|slot| person.offsets(slot, &poses[1]));
    assert_ne!(one, other);
    person.shapes.own[1] = person.shapes.own[0].clone();
    assert_eq!(person.offsets(1, &poses[1]), one);
}

#[test]
fn pictures_move_splats_as_training_does() {
    let mut person = person();
    let device = Device::flex();
    let init = Initial::new(&device, 0);
    let poses = person.poses.clone();
    (person.shapes.record_pose_range(&init, 1, poses[..3].iter())).expect("read");
    let config = person.config.pose_shapes().expect("shapes");
    let body = &person.body;
    let host = HostShapes::read(
        &person.shapes,
        config,
        1,
        body,
        &person.means,
        None,
        &device,
    );
    let host = host.expect("read");
    for pose in &poses {
        let mut rows: Vec<[f32; 3]> = person.means.as_chunks::<3>().0.to_vec();
        host.add(&mut rows, pose);
        let wanted = person.offsets(1, pose);
        assert!(largest(&wanted) > 1e-3);
        let moved = rows.as_flattened().iter().zip(&person.means);
        for ((moved, mean), wanted) in moved.zip(&wanted) {
            assert!(
                (moved - mean - wanted).abs() < 1e-5,
                "{moved} {mean} {wanted}"
            );
        }
    }
}

#[test]
fn a_joint_moves_what_is_near_itself_and_its_own_bones() {
    let person = person();
    let near = Nearness::new(&person.body.skeleton, &person.body.rest, 0.12);
    let joint = |name: &str| {
        let found = person.body.skeleton.names.iter().position(|it| it == name);
        found.expect("a joint")
    };
    let (hip, knee, head) = (joint("l_hip"), joint("l_knee"), joint("head"));
    let at = |k: usize| person.body.rest[k].map(|v| v as f32);
    let thigh: Vec<f32> = (0..3).map(|a| 0.5 * (at(hip)[a] + at(knee)[a])).collect();
    let row = near.dense(&thigh);
    assert!(row[hip] > 0.99, "{}", row[hip]);
    assert!(row[knee] < 0.6, "{}", row[knee]);
    assert_eq!(row[head], 0.0);
}

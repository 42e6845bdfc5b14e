use super::*;
use crate::host::read;
use yoto_capture::skeleton::Skeleton;
use yoto_synthetic::SyntheticPerson;

/// Values of F_nr and of the code itself, after the completed fraction `progress` of a run.
fn codes(tier: &str, progress: f64) -> [Vec<f32>; 2] {
    let device = Device::flex().autodiff();
    let config = ModelConfig::named(tier, "yoto").expect("a tier");
    let (track, _) = SyntheticPerson::cast(1, 7)[0].capture(2, 16);
    let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
    let pose = Pose::from_frame(&track.frames[1]).expect("a pose");
    let body = CanonicalBody::new(skeleton, &config, &device);
    let avatar = Avatar::new(&config, 1, body.skeleton.joints(), 5, &device);
    let posed = avatar.pose(&config, &body, 0, &pose, progress);
    [posed.conditioned, posed.code].map(|code| read(code.expect("a code")).expect("reads"))
}

#[test]
fn codes_are_conditioned_on_poses_once_the_non_rigid_field_needs_it() {
    let [conditioned, code] = codes("fast", 0.2);
    assert_eq!(conditioned, code, "before the kick-in");
    let [conditioned, code] = codes("fast", 0.5);
    assert_ne!(conditioned, code, "after it");
    let [conditioned, code] = codes("splat", 1.0);
    assert_eq!(conditioned, code, "in a tier where the field never wakes");
}

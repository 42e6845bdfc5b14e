//! A person's proportions, and the joints and capsules that follow from them.

use super::drape::{Drape, Garment};
use yoto_capture::skeleton::smpl::JOINTS;
use yoto_capture::skeleton::transform::{add, dot, length, scale, sub};
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Indices of [`JOINTS`] by name; each right joint follows its left counterpart.
pub(crate) mod joint {
    pub(crate) const PELVIS: usize = 0;
    pub(crate) const L_HIP: usize = 1;
    pub(crate) const SPINE1: usize = 3;
    pub(crate) const L_KNEE: usize = 4;
    pub(crate) const SPINE2: usize = 6;
    pub(crate) const L_ANKLE: usize = 7;
    pub(crate) const SPINE3: usize = 9;
    pub(crate) const L_FOOT: usize = 10;
    pub(crate) const NECK: usize = 12;
    pub(crate) const L_COLLAR: usize = 13;
    pub(crate) const HEAD: usize = 15;
    pub(crate) const L_SHOULDER: usize = 16;
    pub(crate) const L_ELBOW: usize = 18;
    pub(crate) const L_WRIST: usize = 20;
    pub(crate) const L_HAND: usize = 22;
}

/// Proportions; 1 is average, unless a unit is given.
#[derive(Clone, Debug)]
pub(crate) struct Build {
    /// Standing height, metres.
    pub height: f64,
    /// Shoulder breadth.
    pub shoulders: f64,
    /// Hip breadth.
    pub hips: f64,
    /// Thickness of the torso.
    pub girth: f64,
    /// Thickness of arms and legs.
    pub limbs: f64,
    /// Protrusion of the belly, metres.
    pub belly: f64,
}

/// The body part of a capsule, which decides the clothes that cover it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BodyPart {
    Torso,
    Neck,
    Head,
    Hair,
    UpperArm,
    Forearm,
    Hand,
    Thigh,
    Shin,
    Foot,
    /// The part of a skirt or coat that hangs from the hips.
    Hem,
}

impl BodyPart {
    /// The rule that moves its cloth with the pose, for parts with moving cloth.
    pub(crate) fn garment(self) -> Option<Garment> {
        match self {
            Self::Hem => Some(Garment::Hem),
            Self::UpperArm | Self::Forearm => Some(Garment::Sleeve),
            _ => None,
        }
    }
}

/// A tapered capsule that moves with a joint. Ends are in the rest pose, metres.
#[derive(Clone, Debug)]
pub(crate) struct Capsule {
    pub joint: usize,
    pub part: BodyPart,
    pub from: Vec3,
    pub to: Vec3,
    pub radii: [f64; 2],
    /// Height at which it is cut off; `None` for a round end.
    pub cut: Option<f64>,
}

impl Capsule {
    /// Signed distance from a point in the rest pose, metres; slightly too large on tapered capsules.
    pub(crate) fn distance(&self, p: Vec3) -> f64 {
        let axis = sub(self.to, self.from);
        let share = share_along(self.from, axis, p);
        let off = length(sub(p, add(self.from, scale(axis, share))));
        let round = off - (self.radii[0] + (self.radii[1] - self.radii[0]) * share);
        self.cut.map_or(round, |height| round.max(height - p[1]))
    }

    /// The point of the axis nearest to `p`.
    pub(crate) fn centre(&self, p: Vec3) -> Vec3 {
        let axis = sub(self.to, self.from);
        add(self.from, scale(axis, share_along(self.from, axis, p)))
    }
}

/// The share of the way from `from` (0) to `from + axis` (1) that is nearest to `p`.
pub(crate) fn share_along(from: Vec3, axis: Vec3, p: Vec3) -> f64 {
    let squared = dot(axis, axis);
    if squared > 0.0 {
        (dot(sub(p, from), axis) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Shapes that clothes and hair add to the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extras {
    /// Lower end of the skirt or coat, 1 at the knee.
    pub hem: f64,
    pub long_hair: bool,
}

/// Height of the unscaled body in [`Build::skeleton`], metres.
const MODEL_HEIGHT: f64 = 1.78;

impl Build {
    /// The rest pose: standing on the floor, arms out.
    pub(crate) fn skeleton(&self) -> Skeleton {
        let left = |x: f64, y: f64, z: f64| [x, y, z];
        let right = |x: f64, y: f64, z: f64| [-x, y, z];
        let reach = 0.18 * self.shoulders;
        let hip = 0.085 * self.hips;
        let side = |at: &dyn Fn(f64, f64, f64) -> Vec3| -> [Vec3; 9] {
            [
                at(hip, 0.9, 0.0),
                at(hip + 0.01, 0.49, 0.005),
                at(hip + 0.015, 0.085, -0.025),
                at(hip + 0.02, 0.03, 0.1),
                at(0.075 * self.shoulders, 1.42, -0.01),
                at(reach, 1.43, -0.01),
                at(reach + 0.27, 1.43, -0.015),
                at(reach + 0.52, 1.43, -0.01),
                at(reach + 0.6, 1.43, -0.005),
            ]
        };
        let (l, r) = (side(&left), side(&right));
        let middle = |y: f64, z: f64| [0.0, y, z];
        let rest = [
            middle(0.95, 0.0),
            l[0],
            r[0],
            middle(1.06, -0.005),
            l[1],
            r[1],
            middle(1.18, -0.005),
            l[2],
            r[2],
            middle(1.27, -0.005),
            l[3],
            r[3],
            middle(1.47, -0.01),
            l[4],
            r[4],
            middle(1.57, 0.01),
            l[5],
            r[5],
            l[6],
            r[6],
            l[7],
            r[7],
            l[8],
            r[8],
        ];
        Skeleton {
            names: JOINTS.iter().map(|(name, _)| (*name).to_owned()).collect(),
            parents: JOINTS.iter().map(|(_, parent)| *parent).collect(),
            rest: rest.map(|p| scale(p, self.scale())).to_vec(),
        }
    }

    /// Factor on the lengths of the unscaled body.
    pub(crate) fn scale(&self) -> f64 {
        self.height / MODEL_HEIGHT
    }

    /// The capsules of flesh and clothes around `skeleton`, which must be this build's.
    pub(crate) fn capsules(&self, skeleton: &Skeleton, extras: Extras) -> Vec<Capsule> {
        let mut parts = Vec::new();
        self.torso(skeleton, &mut parts);
        self.head(skeleton, extras, &mut parts);
        for side in 0..2 {
            self.arm(skeleton, side, &mut parts);
            self.leg(skeleton, side, extras, &mut parts);
        }
        parts
    }

    fn torso(&self, skeleton: &Skeleton, parts: &mut Vec<Capsule>) {
        let s = self.scale();
        // The torso's slices: joint, half breadth, height, forward shift, radius.
        let slices = [
            (joint::PELVIS, 0.075 * self.hips, 0.93, -0.005, 0.112),
            (joint::SPINE1, 0.06, 1.05, 0.6 * self.belly, 0.108),
            (joint::SPINE2, 0.062, 1.17, 0.4 * self.belly, 0.108),
            (joint::SPINE3, 0.08 * self.shoulders, 1.29, 0.0, 0.112),
            (joint::SPINE3, 0.095 * self.shoulders, 1.37, -0.01, 0.088),
        ];
        for (joint, breadth, height, forward, radius) in slices {
            let end = |sign: f64| scale([sign * breadth, height, forward], s);
            let belly = if forward > 0.0 { forward * 0.5 } else { 0.0 };
            let radius = (radius * self.girth + belly) * s;
            parts.push(Capsule {
                joint,
                part: BodyPart::Torso,
                from: end(-1.0),
                to: end(1.0),
                radii: [radius; 2],
                cut: None,
            });
        }
        for side in 0..2 {
            let collar = joint::L_COLLAR + side;
            let shoulder = skeleton.rest[joint::L_SHOULDER + side];
            let from = scale(shoulder, 0.25);
            parts.push(Capsule {
                joint: collar,
                part: BodyPart::Torso,
                from: [from[0], skeleton.rest[collar][1], shoulder[2]],
                to: add(shoulder, [0.0, -0.005 * s, 0.0]),
                radii: [0.062 * s, 0.056 * self.limbs * s],
                cut: None,
            });
        }
    }

    fn head(&self, skeleton: &Skeleton, extras: Extras, parts: &mut Vec<Capsule>) {
        let s = self.scale();
        let neck = skeleton.rest[joint::NECK];
        let head = skeleton.rest[joint::HEAD];
        let mut push = |joint, part, from: Vec3, to: Vec3, radii: [f64; 2]| {
            parts.push(Capsule {
                joint,
                part,
                from,
                to,
                radii: radii.map(|r| r * s),
                cut: None,
            });
        };
        let beside = |[x, y, z]: Vec3| add(head, scale([x, y, z], s));
        let base = add(neck, [0.0, -0.05 * s, 0.0]);
        push(joint::NECK, BodyPart::Neck, base, head, [0.056, 0.052]);
        let (chin, crown) = (beside([0.0, 0.035, 0.03]), beside([0.0, 0.115, 0.012]));
        push(joint::HEAD, BodyPart::Head, chin, crown, [0.07, 0.092]);
        let nose = beside([0.0, 0.055, 0.105]);
        push(joint::HEAD, BodyPart::Head, nose, nose, [0.014, 0.014]);
        let (front, back) = (beside([0.0, 0.135, 0.015]), beside([0.0, 0.1, -0.03]));
        push(joint::HEAD, BodyPart::Hair, front, back, [0.088, 0.09]);
        if extras.long_hair {
            let ends = beside([0.0, -0.1, -0.075]);
            push(joint::HEAD, BodyPart::Hair, back, ends, [0.09, 0.06]);
        }
    }

    fn arm(&self, skeleton: &Skeleton, side: usize, parts: &mut Vec<Capsule>) {
        let at = |joint: usize| skeleton.rest[joint + side];
        let fingers = add(
            at(joint::L_HAND),
            scale(sub(at(joint::L_HAND), at(joint::L_WRIST)), 0.9),
        );
        let thickness = self.scale() * self.limbs;
        let bones = [
            (
                joint::L_SHOULDER,
                BodyPart::UpperArm,
                at(joint::L_ELBOW),
                [0.056, 0.045],
            ),
            (
                joint::L_ELBOW,
                BodyPart::Forearm,
                at(joint::L_WRIST),
                [0.045, 0.034],
            ),
            (
                joint::L_WRIST,
                BodyPart::Hand,
                at(joint::L_HAND),
                [0.034, 0.038],
            ),
            (joint::L_HAND, BodyPart::Hand, fingers, [0.038, 0.026]),
        ];
        for (joint, part, to, radii) in bones {
            parts.push(Capsule {
                joint: joint + side,
                part,
                from: at(joint),
                to,
                radii: radii.map(|r| r * thickness),
                cut: None,
            });
        }
    }

    fn leg(&self, skeleton: &Skeleton, side: usize, extras: Extras, parts: &mut Vec<Capsule>) {
        let s = self.scale();
        let at = |joint: usize| skeleton.rest[joint + side];
        let (hip, knee, ankle) = (at(joint::L_HIP), at(joint::L_KNEE), at(joint::L_ANKLE));
        let foot = at(joint::L_FOOT);
        let beside = |p: Vec3, y: f64, z: f64| [p[0], y * s, p[2] + z * s];
        let limb = |radii: [f64; 2]| radii.map(|r| r * s * self.limbs);
        let mut push = |joint: usize, part, from, to, radii| {
            parts.push(Capsule {
                joint,
                part,
                from,
                to,
                radii,
                cut: None,
            });
        };
        push(
            joint::L_HIP + side,
            BodyPart::Thigh,
            hip,
            knee,
            limb([0.09, 0.062]),
        );
        push(
            joint::L_KNEE + side,
            BodyPart::Shin,
            knee,
            ankle,
            limb([0.062, 0.044]),
        );
        let heel = beside(ankle, 0.045, -0.03);
        let ball = beside(foot, 0.042, 0.0);
        push(
            joint::L_ANKLE + side,
            BodyPart::Foot,
            heel,
            ball,
            [0.045 * s, 0.043 * s],
        );
        let toes = beside(foot, 0.036, 0.07);
        push(
            joint::L_FOOT + side,
            BodyPart::Foot,
            ball,
            toes,
            [0.043 * s, 0.034 * s],
        );
        let hem = self.hem(hip, knee, extras.hem);
        let radii = [0.115 * s * self.girth, self.hem_radius()];
        // The cloth between the legs hangs from the pelvis.
        let inner = |p: Vec3| [0.3 * p[0], p[1], p[2]];
        let middle = scale(add(hip, hem), 0.5);
        push(
            joint::PELVIS,
            BodyPart::Hem,
            inner(hip),
            inner(middle),
            radii,
        );
        parts.push(Capsule {
            joint: joint::L_HIP + side,
            part: BodyPart::Hem,
            from: hip,
            to: hem,
            radii,
            cut: Some(hem[1]),
        });
    }

    fn hem(&self, hip: Vec3, knee: Vec3, length: f64) -> Vec3 {
        add(hip, scale(sub(knee, hip), length))
    }

    /// Thickness of a hem's edge around each leg, metres.
    fn hem_radius(&self) -> f64 {
        0.125 * self.scale() * self.girth
    }

    /// The moving clothes: the hem, and sleeves that end at `sleeves`.
    pub(crate) fn drape(&self, skeleton: &Skeleton, extras: Extras, sleeves: f64) -> Drape {
        let (hip, knee) = (skeleton.rest[joint::L_HIP], skeleton.rest[joint::L_KNEE]);
        let hem = (self.hem(hip, knee, extras.hem)[1], self.hem_radius());
        Drape::new(skeleton, self.scale(), Some(hem), sleeves)
    }
}

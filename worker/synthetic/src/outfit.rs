//! Clothes, skin, hair and face: the colour of every point of the body in the rest pose.

use super::build::{BodyPart, joint};
use std::f64::consts::TAU;
use yoto_capture::skeleton::transform::{add, scale};
use yoto_capture::skeleton::{Skeleton, Vec3};

/// Red, green, blue, 0 to 1.
pub(crate) type Colour = [f64; 3];

const WHITE: Colour = [0.93, 0.93, 0.92];
const EYE: Colour = [0.06, 0.05, 0.05];

/// The pattern of a garment's two colours. Its lengths are tens of centimetres, so that it is visible in
/// small images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pattern {
    /// One colour, with a band of the other across the chest.
    Plain,
    /// Rings around the body.
    Stripes,
    /// A chessboard.
    Checks,
    /// Round dots.
    Dots,
}

/// A garment's cloth.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cloth {
    pub base: Colour,
    pub accent: Colour,
    pub pattern: Pattern,
}

/// All clothes of a person. Lengths along limbs count joints: 1 is the elbow or knee, 2 the wrist or ankle.
#[derive(Clone, Debug)]
pub(crate) struct Outfit {
    pub shirt: Cloth,
    /// End of the sleeves.
    pub sleeves: f64,
    /// Whether the shirt covers the hips and the hem, as a coat.
    pub coat: bool,
    /// Trousers, or a skirt and what is under it.
    pub lower: Cloth,
    /// End of the trousers; 0 with a skirt.
    pub legs: f64,
    pub shoes: Colour,
    pub belt: Colour,
    pub skin: Colour,
    pub hair: Colour,
    /// Heights and distances on this body, metres.
    pub measures: Measures,
}

/// Heights and distances on the body in the rest pose that clothes follow, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measures {
    /// Scale relative to the average body.
    pub scale: f64,
    /// Height of the belt.
    pub waist: f64,
    shoulder_x: f64,
    elbow_x: f64,
    wrist_x: f64,
    hip: Vec3,
    knee_y: f64,
    ankle_y: f64,
    arm_y: f64,
    head: Vec3,
}

impl Measures {
    pub(crate) fn of(skeleton: &Skeleton, scale: f64) -> Self {
        let at = |joint: usize| skeleton.rest[joint];
        Self {
            scale,
            waist: at(joint::PELVIS)[1] + 0.03 * scale,
            shoulder_x: at(joint::L_SHOULDER)[0],
            elbow_x: at(joint::L_ELBOW)[0],
            wrist_x: at(joint::L_WRIST)[0],
            hip: at(joint::L_HIP),
            knee_y: at(joint::L_KNEE)[1],
            ankle_y: at(joint::L_ANKLE)[1],
            arm_y: at(joint::L_SHOULDER)[1],
            head: at(joint::HEAD),
        }
    }
}

impl Outfit {
    /// The colour of `part` at the point `p` with the surface normal `normal`, both in the rest pose. The
    /// shading is painted on: it belongs to the body, not to the light.
    pub(crate) fn colour(&self, part: BodyPart, p: Vec3, normal: Vec3) -> Colour {
        let lit = 0.34 * normal[0] + 0.62 * normal[1] + 0.7 * normal[2];
        scale(self.paint(part, p), 0.84 + 0.15 * lit)
    }

    fn paint(&self, part: BodyPart, p: Vec3) -> Colour {
        let m = &self.measures;
        match part {
            BodyPart::Torso => self.torso(p),
            BodyPart::Neck | BodyPart::Hand => self.skin,
            BodyPart::Head => self.face(p),
            BodyPart::Hair => self.hair,
            BodyPart::UpperArm => {
                let along = (p[0].abs() - m.shoulder_x) / (m.elbow_x - m.shoulder_x);
                self.sleeve(p, along)
            }
            BodyPart::Forearm => {
                let along = (p[0].abs() - m.elbow_x) / (m.wrist_x - m.elbow_x);
                self.sleeve(p, 1.0 + along)
            }
            BodyPart::Thigh => self.leg(p, (m.hip[1] - p[1]) / (m.hip[1] - m.knee_y)),
            BodyPart::Shin => self.leg(p, 1.0 + (m.knee_y - p[1]) / (m.knee_y - m.ankle_y)),
            BodyPart::Foot => {
                let sole = smooth_step(0.014 * m.scale, 0.02 * m.scale, p[1]);
                mix(WHITE, self.shoes, sole)
            }
            BodyPart::Hem => {
                let cloth = if self.coat { self.shirt } else { self.lower };
                cloth.at(p[0].atan2(p[2]) / TAU, p[1], m.scale)
            }
        }
    }

    fn torso(&self, p: Vec3) -> Colour {
        let m = &self.measures;
        let around = p[0].atan2(p[2]) / TAU;
        let above = p[1] - m.waist;
        let half_belt = 0.02 * m.scale;
        let mut shirt = self.shirt.at(around, p[1], m.scale);
        if self.shirt.pattern == Pattern::Plain {
            let off = (above / m.scale - 0.3).abs();
            shirt = mix(self.shirt.accent, shirt, smooth_step(0.05, 0.06, off));
        }
        let cloth = if self.coat { self.shirt } else { self.lower };
        let lower = cloth.at(around, p[1], m.scale);
        let edge = 0.004 * m.scale;
        let dressed = mix(lower, shirt, smooth_step(-edge, edge, above));
        mix(
            self.belt,
            dressed,
            smooth_step(half_belt - edge, half_belt + edge, above.abs()),
        )
    }

    fn sleeve(&self, p: Vec3, along: f64) -> Colour {
        let m = &self.measures;
        let around = (p[1] - m.arm_y).atan2(p[2]) / TAU * 0.5;
        let shirt = self.shirt.at(around, p[0].abs(), m.scale);
        mix(
            shirt,
            self.skin,
            smooth_step(self.sleeves - 0.02, self.sleeves + 0.02, along),
        )
    }

    /// Whether a sleeve covers `p`, a point of the arm in the rest pose.
    pub(crate) fn sleeve_covers(&self, p: Vec3) -> bool {
        let m = &self.measures;
        let forearm = (p[0].abs() - m.elbow_x) / (m.wrist_x - m.elbow_x);
        1.0 + forearm < self.sleeves
    }

    fn leg(&self, p: Vec3, along: f64) -> Colour {
        let m = &self.measures;
        let around = (p[0].abs() - m.hip[0]).atan2(p[2]) / TAU * 0.5;
        let cloth = self.lower.at(around, p[1], m.scale);
        mix(
            cloth,
            self.skin,
            smooth_step(self.legs - 0.02, self.legs + 0.02, along),
        )
    }

    /// Eyes, brows and mouth in front, hair at the back and above the forehead.
    fn face(&self, p: Vec3) -> Colour {
        let m = &self.measures;
        let [x, y, z] = scale(add(p, scale(m.head, -1.0)), 1.0 / m.scale);
        let hairline = (y - 0.15).max(0.02 - z - 0.35 * (0.09 - y).max(0.0));
        let mut colour = mix(self.skin, self.hair, smooth_step(-0.004, 0.004, hairline));
        if z > 0.04 {
            let spot = |cx: f64, cy: f64, rx: f64, ry: f64| {
                let off = ((x.abs() - cx) / rx).hypot((y - cy) / ry);
                1.0 - smooth_step(0.85, 1.15, off)
            };
            colour = mix(colour, WHITE, spot(0.034, 0.085, 0.019, 0.013));
            colour = mix(colour, EYE, spot(0.034, 0.085, 0.01, 0.012));
            colour = mix(colour, self.hair, spot(0.034, 0.112, 0.02, 0.006));
            colour = mix(colour, [0.62, 0.2, 0.2], spot(0.0, 0.015, 0.027, 0.008));
        }
        colour
    }
}

impl Cloth {
    /// The cloth's colour `around` the body (turns) at `along` it (metres).
    fn at(&self, around: f64, along: f64, scale: f64) -> Colour {
        let along = along / scale;
        let accent = match self.pattern {
            Pattern::Plain => 0.0,
            Pattern::Stripes => 0.5 + 0.5 * wave(along / 0.11),
            Pattern::Checks => 0.5 + 0.5 * wave(around * 6.0) * wave(along / 0.15),
            Pattern::Dots => {
                let row = along / 0.1;
                let column = around * 8.0 + 0.5 * (row.floor().rem_euclid(2.0));
                let off = |v: f64| v - v.floor() - 0.5;
                1.0 - smooth_step(0.27, 0.35, off(row).hypot(off(column)))
            }
        };
        mix(self.base, self.accent, accent)
    }
}

/// A square wave of period 1 between -1 and 1 with edges a few millimetres wide.
fn wave(x: f64) -> f64 {
    (5.0 * (TAU * x).sin()).clamp(-1.0, 1.0)
}

/// 0 below `from`, 1 above `to`, smooth between.
pub(crate) fn smooth_step(from: f64, to: f64, x: f64) -> f64 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn mix(a: Colour, b: Colour, share: f64) -> Colour {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * share)
}

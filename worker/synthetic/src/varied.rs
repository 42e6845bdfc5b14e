//! People with the variety of real captures, for the bounds of the check of captures.

use super::SyntheticPerson;
use super::build::{Build, Extras, Hair};
use super::cast::{HAIRS, NAMES, SHIRTS, SKINS, colour};
use super::motion::Gait;
use super::outfit::{Cloth, Colour, Measures, Outfit, Pattern};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const HAIR: [Hair; 5] = [
    Hair::Short,
    Hair::Long,
    Hair::Ponytail,
    Hair::Bun,
    Hair::Full,
];
/// A colour that cameras can't distinguish from black.
const BLACK: Colour = [0.012, 0.012, 0.014];

/// The brightness of a person's clothes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tone {
    Black,
    Dark,
    Coloured,
    Bright,
}

const TONES: [Tone; 4] = [Tone::Coloured, Tone::Black, Tone::Bright, Tone::Dark];

pub(crate) fn varied(n: usize, seed: u64) -> Vec<SyntheticPerson> {
    (0..n)
        .map(|i| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(i as u64 + 1);
            person(i, &mut rng)
        })
        .collect()
}

fn person(i: usize, rng: &mut impl Rng) -> SyntheticPerson {
    let build = Build {
        height: rng.random_range(1.5..1.95),
        shoulders: rng.random_range(0.88..1.2),
        hips: rng.random_range(0.92..1.3),
        girth: rng.random_range(0.82..1.5),
        limbs: rng.random_range(0.8..1.4),
        belly: often(rng, 0.3) * rng.random_range(0.03..0.13),
    };
    let dressed = rng.random_bool(0.5);
    let extras = Extras {
        hem: dressed.then(|| rng.random_range(0.3..1.1)),
        flare: rng.random_range(0.9..1.5),
        hair: HAIR[i % HAIR.len()],
        sleeves: 1.0 + often(rng, 0.4) * rng.random_range(0.4..1.8),
        trousers: 1.0 + often(rng, 0.4) * rng.random_range(0.3..1.0),
        pack: often(rng, 0.15) * rng.random_range(0.08..0.2),
    };
    let sleeves = rng.random_range(0.5..1.95);
    let skeleton = build.skeleton();
    let capsules = build.capsules(&skeleton, extras);
    let drape = build.drape(&skeleton, extras, sleeves);
    let tone = TONES[i % TONES.len()];
    let mut cloth = || {
        let hue = rng.random();
        let [base, accent] = match tone {
            Tone::Black => [BLACK; 2],
            Tone::Dark => [colour(hue, 0.5, 0.16), colour(hue, 0.4, 0.24)],
            Tone::Coloured => [colour(hue, 0.7, 0.7), colour(hue + 0.4, 0.4, 0.85)],
            Tone::Bright => [[0.95, 0.95, 0.94], colour(hue, 0.3, 0.9)],
        };
        Cloth {
            base,
            accent,
            pattern: SHIRTS[rng.random_range(0..SHIRTS.len())],
        }
    };
    let (shirt, lower) = (cloth(), cloth());
    let coat = dressed && rng.random_bool(0.5);
    let dark = tone == Tone::Black;
    let outfit = Outfit {
        shirt,
        sleeves,
        coat,
        lower: Cloth {
            pattern: if rng.random_bool(0.7) {
                Pattern::Plain
            } else {
                lower.pattern
            },
            ..lower
        },
        legs: if dressed && !coat {
            0.0
        } else {
            rng.random_range(0.8..1.95)
        },
        shoes: if dark {
            BLACK
        } else {
            colour(rng.random(), 0.5, rng.random_range(0.1..0.9))
        },
        belt: if dark { BLACK } else { [0.16, 0.11, 0.08] },
        skin: SKINS[rng.random_range(0..SKINS.len())],
        hair: if dark {
            BLACK
        } else {
            HAIRS[rng.random_range(0..HAIRS.len())]
        },
        measures: Measures::of(&skeleton, build.scale()),
    };
    let name = NAMES[i % NAMES.len()];
    SyntheticPerson {
        name: format!("{name}-{}", 1 + i / NAMES.len()),
        skeleton,
        capsules,
        outfit,
        drape,
        gait: Gait {
            turn: if rng.random() { 1.0 } else { -1.0 },
            phase: rng.random_range(0.0..TAU),
            vigour: rng.random_range(0.1..1.2),
            turns: f64::from(rng.random_range(1..=2_u8)),
            strides: rng.random_range(4.0..9.0),
            arms: if rng.random_bool(0.4) {
                0.0
            } else {
                rng.random_range(0.3..1.0)
            },
        },
    }
}

/// 1 with a probability of `share`, 0 otherwise.
fn often(rng: &mut impl Rng, share: f64) -> f64 {
    f64::from(u8::from(rng.random_bool(share)))
}

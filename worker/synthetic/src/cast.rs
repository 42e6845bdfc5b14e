//! The cast: people with clearly different builds, clothes and colours.

use super::SyntheticPerson;
use super::build::{Build, Extras};
use super::motion::Gait;
use super::outfit::{Cloth, Colour, Measures, Outfit, Pattern};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

const NAMES: [&str; 12] = [
    "ada", "bruno", "chloe", "dmitri", "esra", "femi", "greta", "hugo", "ines", "jun", "kofi",
    "lena",
];
const SKINS: [Colour; 4] = [
    [0.93, 0.74, 0.62],
    [0.55, 0.36, 0.25],
    [0.82, 0.6, 0.44],
    [0.38, 0.25, 0.18],
];
const HAIRS: [Colour; 5] = [
    [0.3, 0.17, 0.09],
    [0.08, 0.07, 0.07],
    [0.83, 0.66, 0.3],
    [0.56, 0.22, 0.08],
    [0.6, 0.6, 0.6],
];
const SHIRTS: [Pattern; 4] = [
    Pattern::Stripes,
    Pattern::Checks,
    Pattern::Dots,
    Pattern::Plain,
];

/// A type of body and clothes, slightly varied for each person.
struct Type {
    build: Build,
    extras: Extras,
    /// Whether the hem belongs to a coat and not to a skirt.
    coat: bool,
    sleeves: f64,
    legs: f64,
    lower: Pattern,
}

fn types() -> [Type; 5] {
    let make = |numbers: [f64; 6], hem, coat, long_hair, sleeves, legs, lower| {
        let [height, shoulders, hips, girth, limbs, belly] = numbers;
        Type {
            build: Build {
                height,
                shoulders,
                hips,
                girth,
                limbs,
                belly,
            },
            extras: Extras { hem, long_hair },
            coat,
            sleeves,
            legs,
            lower,
        }
    };
    [
        // Slim, in a skirt and three-quarter sleeves.
        make(
            [1.68, 0.92, 1.08, 0.9, 0.92, 0.0],
            0.95,
            false,
            true,
            1.5,
            0.0,
            Pattern::Plain,
        ),
        // Tall and broad, in a coat over long trousers.
        make(
            [1.85, 1.18, 1.05, 1.1, 1.15, 0.0],
            0.7,
            true,
            false,
            1.92,
            1.95,
            Pattern::Plain,
        ),
        // Short and stout, in a long T-shirt over shorts.
        make(
            [1.62, 1.05, 1.3, 1.35, 1.25, 0.1],
            0.45,
            true,
            false,
            0.75,
            0.9,
            Pattern::Plain,
        ),
        // Lanky, in a tunic with sleeves over the elbows, and long trousers.
        make(
            [1.8, 0.95, 0.95, 0.86, 0.88, 0.0],
            0.55,
            true,
            true,
            1.4,
            1.9,
            Pattern::Plain,
        ),
        // Sturdy, in a patterned skirt and long sleeves.
        make(
            [1.72, 1.0, 1.2, 1.12, 1.06, 0.05],
            0.9,
            false,
            false,
            1.9,
            0.0,
            Pattern::Stripes,
        ),
    ]
}

pub(crate) fn cast(n: usize, seed: u64) -> Vec<SyntheticPerson> {
    let mut shared = ChaCha8Rng::seed_from_u64(seed);
    let first_hue: f64 = shared.random();
    let offsets: [usize; 3] = std::array::from_fn(|_| shared.random_range(0..60));
    (0..n)
        .map(|i| {
            let mut own = ChaCha8Rng::seed_from_u64(seed);
            own.set_stream(i as u64 + 1);
            person(i, first_hue, offsets, &mut own)
        })
        .collect()
}

fn person(i: usize, first_hue: f64, offsets: [usize; 3], rng: &mut impl Rng) -> SyntheticPerson {
    let mut types = types();
    let count = types.len();
    let chosen = &mut types[i % count];
    let mut vary = |value: &mut f64, by: f64| *value *= 1.0 + rng.random_range(-by..by);
    vary(&mut chosen.build.height, 0.015);
    vary(&mut chosen.build.shoulders, 0.03);
    vary(&mut chosen.build.hips, 0.03);
    vary(&mut chosen.build.girth, 0.03);
    vary(&mut chosen.build.limbs, 0.03);

    let skeleton = chosen.build.skeleton();
    let capsules = chosen.build.capsules(&skeleton, chosen.extras);
    let drape = chosen.build.drape(&skeleton, chosen.extras, chosen.sleeves);
    // Steps by the golden ratio keep hues apart for any number of people.
    let even = i.is_multiple_of(2);
    let hue = first_hue + i as f64 * 0.618_034;
    let outfit = Outfit {
        shirt: Cloth {
            base: colour(hue, 0.75, 0.85),
            accent: if even {
                [0.94, 0.93, 0.88]
            } else {
                colour(hue + 0.08, 0.85, 0.3)
            },
            pattern: SHIRTS[(i + offsets[0]) % SHIRTS.len()],
        },
        sleeves: chosen.sleeves,
        coat: chosen.coat,
        lower: Cloth {
            base: colour(hue + 0.45, 0.55, if even { 0.4 } else { 0.62 }),
            accent: colour(hue + 0.5, 0.35, 0.85),
            pattern: chosen.lower,
        },
        legs: chosen.legs,
        shoes: colour(hue + 0.3, 0.7, if even { 0.7 } else { 0.22 }),
        belt: [0.16, 0.11, 0.08],
        skin: SKINS[(i + offsets[1]) % SKINS.len()],
        hair: HAIRS[(i + offsets[2]) % HAIRS.len()],
        measures: Measures::of(&skeleton, chosen.build.scale()),
    };
    let round = i / NAMES.len();
    let name = NAMES[i % NAMES.len()];
    SyntheticPerson {
        name: if round == 0 {
            name.to_owned()
        } else {
            format!("{name}-{}", round + 1)
        },
        skeleton,
        capsules,
        outfit,
        drape,
        gait: Gait {
            turn: if even { 1.0 } else { -1.0 },
            phase: rng.random_range(0.0..TAU),
            vigour: rng.random_range(0.85..1.15),
        },
    }
}

/// A colour by hue (turns), saturation and value (0 to 1).
fn colour(hue: f64, saturation: f64, value: f64) -> Colour {
    std::array::from_fn(|channel| {
        let at = (6.0 * hue + [5.0, 3.0, 1.0][channel]).rem_euclid(6.0);
        value * (1.0 - saturation * at.min(4.0 - at).clamp(0.0, 1.0))
    })
}

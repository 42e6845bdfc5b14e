//! A disc with soft edges before a patterned wall, with masks of several kinds.

use super::*;

const SIDE: usize = 160;
/// Colour of the disc.
const OWN: [f32; 3] = [60.0, 90.0, 40.0];

/// Coverage by a disc of `radius` at `x`, soft over a pixel.
fn disc(x: f32, radius: f32) -> Vec<f32> {
    let at = |i: usize| {
        let off = [(i % SIDE) as f32 - x, (i / SIDE) as f32 - 80.0];
        (radius - off[0].hypot(off[1]) + 0.5).clamp(0.0, 1.0)
    };
    (0..SIDE * SIDE).map(at).collect()
}

/// The wall's colour at a pixel.
fn wall(i: usize) -> [f32; 3] {
    let (x, y) = (i % SIDE, i / SIDE);
    let tile = if (x / 9 + y / 13) % 2 == 0 {
        200.0
    } else {
        150.0
    };
    [tile, tile + 20.0, tile + (x % 3) as f32]
}

/// The disc before the wall.
fn filmed(coverage: &[f32]) -> Picture {
    filmed_before(coverage, wall)
}

/// The disc before a background of this colour at a pixel.
fn filmed_before(coverage: &[f32], wall: impl Fn(usize) -> [f32; 3]) -> Picture {
    let mut picture = Picture {
        width: SIDE,
        height: SIDE,
        rgb: Vec::with_capacity(3 * SIDE * SIDE),
        alpha: None,
        lossy: true,
    };
    for (i, m) in coverage.iter().enumerate() {
        for (c, (own, wall)) in OWN.iter().zip(wall(i)).enumerate() {
            let noise = ((i * 7 + c * 3) % 5) as f32 - 2.0;
            let value = m * own + (1.0 - m) * wall + noise;
            picture.rgb.push(value.clamp(0.0, 255.0) as u8);
        }
    }
    picture
}

/// The wall, learned from frames in which the disc stands elsewhere.
fn learned() -> KnownBackground {
    let mut builder = BackgroundBuilder::new(SIDE, SIDE);
    for x in [30.0, 40.0, 120.0, 130.0, 135.0] {
        let coverage = disc(x, 24.0);
        builder.add(&filmed(&coverage), &levels(&coverage));
    }
    builder.finish()
}

fn levels(coverage: &[f32]) -> Vec<u8> {
    coverage
        .iter()
        .map(|it| (it * 255.0).round() as u8)
        .collect()
}

/// Root mean squared errors of coverage, and of premultiplied colours as shares of 255, within 4 pixels of the edge.
fn errors(rgb: &[u8], mask: &[u8], truth: &[f32]) -> [f32; 2] {
    let near = disc(80.0, 28.0);
    let far = disc(80.0, 20.0);
    let (mut sums, mut count) = ([0.0f32; 2], 0.0);
    for i in (0..truth.len()).filter(|i| near[*i] > 0.5 && far[*i] < 0.5) {
        sums[0] += (f32::from(mask[i]) / 255.0 - truth[i]).powi(2);
        for (seen, own) in rgb[3 * i..].iter().zip(OWN) {
            let off = f32::from(*seen) - truth[i] * own;
            sums[1] += (off / 255.0).powi(2) / 3.0;
        }
        count += 1.0;
    }
    sums.map(|it| (it / count).sqrt())
}

/// Errors of the given mask, multiplied in, and of the solved one.
fn before_and_after(mask: &[u8], known: &KnownBackground) -> [[f32; 2]; 2] {
    errors_of(filmed(&disc(80.0, 24.0)), mask, known)
}

/// The error for a picture of the disc.
fn errors_of(picture: Picture, mask: &[u8], known: &KnownBackground) -> [[f32; 2]; 2] {
    let truth = disc(80.0, 24.0);
    let scene = yoto_proto::media_plan::Background::Scene;
    let given = crate::compose::over_black(picture.clone(), mask, scene);
    let mut solved = mask.to_vec();
    let rgb = refine(picture, &mut solved, known);
    [errors(&given, mask, &truth), errors(&rgb, &solved, &truth)]
}

#[test]
fn a_wall_that_a_coarse_mask_has_taken_in_is_left_out() {
    let [given, solved] = before_and_after(&levels(&disc(80.5, 25.0)), &learned());
    assert!(solved[0] < 0.6 * given[0], "{given:?} {solved:?}");
    assert!(solved[1] < 0.4 * given[1], "{given:?} {solved:?}");
}

#[test]
fn a_moving_camera_is_helped_by_what_is_around() {
    let nothing = BackgroundBuilder::new(SIDE, SIDE).finish();
    assert_eq!(nothing.share(), 0.0);
    let [given, solved] = before_and_after(&levels(&disc(80.5, 25.0)), &nothing);
    assert!(solved[1] < 0.7 * given[1], "{given:?} {solved:?}");
}

#[test]
fn a_camera_held_by_hand_is_as_good_as_one_on_a_stand() {
    // It looks alike from nowhere else.
    let poster = |x: i32, y: i32| {
        let (x, y) = (x as f32, y as f32);
        let wave = (0.11 * x + 0.05 * y).sin() + (0.15 * y - 0.0007 * x * x).sin();
        let edge = if (x + 0.4 * y).rem_euclid(23.0) < 9.0 {
            20.0
        } else {
            -20.0
        };
        [
            150.0 + 20.0 * wave + edge,
            150.0 - edge,
            180.0 + 25.0 * wave,
        ]
    };
    let turned =
        |x: i32, y: i32| move |i: usize| poster((i % SIDE) as i32 + x, (i / SIDE) as i32 + y);
    let errors = |turns: &[[i32; 2]; 5]| {
        let mut builder = BackgroundBuilder::new(SIDE, SIDE);
        for (x, [right, down]) in [30.0, 40.0, 120.0, 130.0, 135.0].iter().zip(turns) {
            let coverage = disc(*x, 24.0);
            let picture = filmed_before(&coverage, turned(*right, *down));
            builder.add(&picture, &levels(&coverage));
        }
        let picture = filmed_before(&disc(80.0, 24.0), turned(-7, 5));
        errors_of(picture, &levels(&disc(80.5, 25.0)), &builder.finish())
    };
    let [_, still] = errors(&[[-7, 5]; 5]);
    let [_, by_hand] = errors(&[[0, 0], [4, -3], [9, 2], [-6, 6], [-11, -8]]);
    assert!(by_hand[0] < 1.1 * still[0], "{still:?} {by_hand:?}");
    assert!(by_hand[1] < 1.1 * still[1], "{still:?} {by_hand:?}");
}

#[test]
fn a_line_of_an_unknown_wall_is_no_part_of_a_person() {
    let striped = |i: usize| match i / SIDE % 16 {
        0..3 => [20.0; 3],
        _ => [220.0, 225.0, 230.0],
    };
    let mut mask = levels(&disc(80.0, 26.0));
    let nothing = BackgroundBuilder::new(SIDE, SIDE).finish();
    let truth = disc(80.0, 24.0);
    refine(filmed_before(&truth, striped), &mut mask, &nothing);
    let lines = (0..mask.len()).filter(|i| truth[*i] == 0.0 && striped(*i)[0] < 100.0);
    let covered: u32 = lines.map(|i| u32::from(mask[i])).sum();
    assert!(covered < 24 * 255, "{covered}");
}

#[test]
fn an_exact_mask_stays_and_its_colours_lose_the_wall() {
    let [given, solved] = before_and_after(&levels(&disc(80.0, 24.0)), &learned());
    assert!(given[0] < 0.01 && solved[0] < 0.04, "{given:?} {solved:?}");
    assert!(solved[1] < 0.5 * given[1], "{given:?} {solved:?}");
}

#[test]
fn what_passes_by_is_no_background() {
    let known = learned();
    assert!(known.share() > 0.9, "{}", known.share());
    let mut builder = BackgroundBuilder::new(SIDE, SIDE);
    let nobody = vec![0; SIDE * SIDE];
    for x in [30.0, 40.0, 120.0, 130.0, 135.0] {
        builder.add(&filmed(&disc(x, 24.0)), &nobody);
    }
    let passed = builder.finish();
    let middle = 80 * SIDE + 60;
    for at in [middle, 80 * SIDE + 5] {
        let colour = passed.colours[at].expect("is known");
        assert!(
            (f32::from(colour[0]) - wall(at)[0]).abs() < 4.0,
            "{colour:?}"
        );
    }
}

#[test]
fn nobody_and_slivers_are_no_trouble() {
    let picture = filmed(&disc(80.0, 0.0));
    let known = learned();
    for coverage in [0, 100] {
        let mut mask = vec![coverage; SIDE * SIDE];
        let rgb = refine(picture.clone(), &mut mask, &known);
        assert_eq!(mask[0], coverage);
        assert_eq!(rgb[0] == 0, coverage == 0);
    }
    let mut mask = vec![0; SIDE * SIDE];
    mask[SIDE - 1] = 255;
    mask[SIDE * SIDE - 1] = 255;
    refine(picture.clone(), &mut mask, &known);
    let mut all = vec![255; SIDE * SIDE];
    let rgb = refine(picture.clone(), &mut all, &known);
    assert!(all.iter().all(|it| *it == 255));
    assert_eq!(rgb, picture.rgb);
}

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
    let truth = disc(80.0, 24.0);
    let picture = filmed(&truth);
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
        let colour = passed.at(at).expect("is known");
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

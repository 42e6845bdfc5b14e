//! Splats at the extremes of their numbers: values and gradients stay finite, and equal those of double precision or a
//! closed form. Prints rows of the table of `docs/research/numerics.md`, whose top has the command.

use super::splat_f64::{ROW, picture, sum};
use super::table::{error, report, values};
use burn::tensor::{Device, Tensor, TensorData};
use yoto_ops::splat::{MIN_ALPHA, NEAR, Splats, View, splat};

/// Columns of a row: transform, mean, rotation, scales, opacity, colour.
const PARTS: [(usize, usize); 6] = [(0, 12), (12, 3), (15, 4), (19, 3), (22, 1), (23, 3)];
const MEAN_Z: usize = 14;
const QUATERNION: usize = 15;
const SCALES: usize = 19;
const OPACITY: usize = 22;
const COLOUR: usize = 23;
/// Largest error of a value, over the largest value or 1.
const BOUND: f64 = 2e-5;
/// Largest error of a gradient, over the largest of its kind or 1.
const SLOPE_BOUND: f64 = 2e-3;
/// Half of the difference between two values of a parameter, over its magnitude or 1; of a quaternion, over its length.
const STEP: f64 = 1e-6;

/// A camera at the origin of the body that looks along z.
fn view(width: usize, height: usize) -> View {
    View {
        width,
        height,
        k: [
            [100.0, 0.0, width as f32 / 2.0],
            [0.0, 100.0, height as f32 / 2.0],
        ],
        e: [
            [1.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
        world: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

/// A splat of some centimetres, two metres in front of the camera and a little beside its axis.
fn plain() -> [f32; ROW] {
    let mut row = [0.0; ROW];
    for diagonal in [0, 5, 10] {
        row[diagonal] = 1.0;
    }
    row[12..15].copy_from_slice(&[0.013, -0.027, 2.0]);
    row[QUATERNION..SCALES].copy_from_slice(&[0.9, 0.3, -0.2, 0.1]);
    row[SCALES..OPACITY].copy_from_slice(&[0.05f32, 0.03, 0.02].map(f32::ln));
    row[OPACITY] = 0.5;
    row[COLOUR..].copy_from_slice(&[0.2, 0.5, 0.8]);
    row
}

/// The same, behind the others.
fn farther() -> [f32; ROW] {
    with(|it| it[MEAN_Z] = 2.3)
}

fn with(change: impl Fn(&mut [f32; ROW])) -> [f32; ROW] {
    let mut row = plain();
    change(&mut row);
    row
}

fn light() -> Vec<f32> {
    (0..24).map(|at| (at as f32 * 0.7).sin() / 10.0).collect()
}

/// What the operation computes.
struct Gradients {
    picture: Vec<f32>,
    /// `[N, 26]`, as the rows.
    gradients: Vec<f32>,
    light: Vec<f32>,
}

/// The picture of the splats with these `rows`, and the gradients of its sum weighted by `towards`.
fn run(rows: &[[f32; ROW]], light: &[f32], view: &View, towards: &[f32]) -> Gradients {
    let device = Device::flex().autodiff();
    let count = rows.len();
    let leaf = |(first, columns): (usize, usize)| {
        let numbers = rows.iter().flat_map(|row| &row[first..first + columns]);
        let data = TensorData::new(numbers.copied().collect::<Vec<_>>(), [count, columns]);
        Tensor::<2>::from_data(data, &device).require_grad()
    };
    let leaves = PARTS.map(leaf);
    let [transforms, means, rotations, scales, opacities, colours] = leaves.clone();
    let light = TensorData::new(light.to_vec(), [3, 8]);
    let light = Tensor::<2>::from_data(light, &device).require_grad();
    let splats = Splats {
        transforms,
        means,
        rotations,
        scales,
        opacities: opacities.reshape([count]),
        colours,
        harmonics: None,
        light: light.clone(),
    };
    let picture = splat(splats, view);
    let towards = TensorData::new(towards.to_vec(), picture.dims());
    let towards = Tensor::<2>::from_data(towards, &device);
    let grads = (picture.clone() * towards).sum().backward();
    let parts = leaves.map(|leaf| values(leaf.grad(&grads).expect("tracked")));
    let row = |at: usize| {
        let parts = parts.iter().zip(PARTS);
        parts.flat_map(move |(part, (_, columns))| &part[at * columns..(at + 1) * columns])
    };
    Gradients {
        picture: values(picture),
        gradients: (0..count).flat_map(row).copied().collect(),
        light: values(light.grad(&grads).expect("tracked")),
    }
}

/// Weights of the pixels' numbers, `[H W, 4]`.
fn towards(view: &View) -> Vec<f32> {
    let numbers = 0..4 * view.width * view.height;
    numbers.map(|at| (at as f32 * 1.3).cos()).collect()
}

fn doubles(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|v| f64::from(*v)).collect()
}

/// Prints the row of a case, and compares its picture with the `exact` one.
fn show(case: &str, found: &Gradients, exact: &[f64], bound: f64) {
    let off = Some(error(&found.picture, exact));
    report("splat", case, &found.picture, &found.gradients, off, bound);
}

/// Reports the picture of `rows` and its gradients beside those of double precision.
fn compare(case: &str, rows: &[[f32; ROW]], view: &View) {
    compare_within(case, rows, view, BOUND, SLOPE_BOUND);
}

fn compare_within(case: &str, rows: &[[f32; ROW]], view: &View, bound: f64, slope_bound: f64) {
    let (towards, light) = (towards(view), light());
    let found = run(rows, &light, view, &towards);
    let (exact, light) = (doubles(rows.as_flattened()), doubles(&light));
    show(case, &found, &picture(&exact, &light, view), bound);
    assert!(found.light.iter().all(|v| v.is_finite()), "{case}: light");
    for (first, columns) in PARTS {
        let at = |index: &usize| (first..first + columns).contains(&(index % ROW));
        let indices: Vec<usize> = (0..exact.len()).filter(at).collect();
        let slopes = indices.iter().map(|index| {
            let row = &exact[index / ROW * ROW..][..ROW];
            let quaternion = &row[QUATERNION..SCALES];
            let step = match first {
                QUATERNION => STEP * quaternion.iter().map(|q| q * q).sum::<f64>().sqrt(),
                _ => STEP * exact[*index].abs().max(1.0),
            };
            let moved = |by: f64| {
                let mut moved = exact.clone();
                moved[*index] += by;
                sum(&moved, &light, view, &towards)
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        });
        let slopes: Vec<f64> = slopes.collect();
        let ours: Vec<f32> = indices.iter().map(|i| found.gradients[*i]).collect();
        let off = error(&ours, &slopes);
        assert!(
            off <= slope_bound,
            "{case}: columns from {first}: {off:e}: {ours:?}, not {slopes:?}"
        );
    }
}

/// Reports a splat that is not drawn, beside one that is.
fn not_drawn(case: &str, row: [f32; ROW]) {
    let view = view(16, 16);
    let towards = towards(&view);
    let alone = run(&[plain()], &light(), &view, &towards);
    let found = run(&[row, plain()], &light(), &view, &towards);
    show(case, &found, &doubles(&alone.picture), 0.0);
    assert_eq!(found.gradients[..ROW], [0.0; ROW], "{case}");
    assert_eq!(found.gradients[ROW..], alone.gradients, "{case}");
    assert_eq!(found.light, alone.light, "{case}");
}

#[test]
fn positions_at_the_camera() {
    not_drawn("at the camera", with(|it| it[12..15].fill(0.0)));
    not_drawn("behind it", with(|it| it[MEAN_Z] = -2.0));
    not_drawn("on the near plane", with(|it| it[MEAN_Z] = NEAR));
    let behind = with(|it| it[MEAN_Z] = NEAR + 1e-5);
    compare("0.01 mm behind the near plane", &[behind], &view(16, 16));
    compare("10 km away", &[with(|it| it[MEAN_Z] = 1e4)], &view(16, 16));
}

#[test]
fn scales_from_nothing_to_kilometres() {
    let of =
        |metres: [f32; 3]| with(|it| it[SCALES..OPACITY].copy_from_slice(&metres.map(f32::ln)));
    let view = view(16, 16);
    compare("scale of 1e-9 m", &[of([1e-9; 3])], &view);
    compare("scale of 1 km", &[of([1e3; 3])], &view);
    compare("scale of 1e15 m", &[of([1e15; 3])], &view);
    compare("one scale 0", &[of([0.05, 0.0, 0.02])], &view);
    compare("two scales 0", &[of([0.05, 0.0, 0.0])], &view);
    compare("all scales 0", &[of([0.0; 3])], &view);
    // The product of the variances is far above the determinant. Gradients of the longer needle, of 5,000 pixels, lose
    // digits in single precision.
    compare("scales of 1 m and 1e-8 m", &[of([1.0, 1e-8, 1e-8])], &view);
    let needle = "scales of 100 m and 1e-6 m";
    compare_within(needle, &[of([100.0, 1e-6, 1e-6])], &view, BOUND, 0.2);
}

#[test]
fn opacities_from_nothing_to_all() {
    let of = |logit: f32| with(|it| it[OPACITY] = logit);
    compare("opacity logit 100", &[of(100.0), farther()], &view(16, 16));
    compare("opacity logit +∞", &[of(f32::INFINITY)], &view(16, 16));
    not_drawn("opacity logit −100", of(-100.0));
    not_drawn("opacity logit −∞", of(f32::NEG_INFINITY));
}

#[test]
fn rotations_of_any_length() {
    let of = |quaternion: [f32; 4]| with(|it| it[QUATERNION..SCALES].copy_from_slice(&quaternion));
    let times = |factor: f32| of([0.9, 0.3, -0.2, 0.1].map(|q| q * factor));
    let view = view(16, 16);
    compare("quaternion of length 1e20", &[times(1e20)], &view);
    compare("quaternion of length 1e-9", &[times(1e-9)], &view);
    // The slope is above what f32 holds.
    let short = run(&[times(1e-38)], &light(), &view, &towards(&view));
    let exact = picture(&doubles(&times(1e-38)), &doubles(&light()), &view);
    show("quaternion of length 1e-38", &short, &exact, BOUND);
    let zero = run(&[of([0.0; 4])], &light(), &view, &towards(&view));
    let identity = run(
        &[of([1.0, 0.0, 0.0, 0.0])],
        &light(),
        &view,
        &towards(&view),
    );
    show(
        "quaternion 0: no rotation",
        &zero,
        &doubles(&identity.picture),
        0.0,
    );
}

#[test]
fn numbers_that_are_not_finite() {
    let names = [
        "transform",
        "mean",
        "rotation",
        "scales",
        "opacity",
        "colour",
    ];
    for ((first, columns), name) in PARTS.into_iter().zip(names) {
        for column in first..first + columns {
            let values = [
                ("NaN", f32::NAN),
                ("∞", f32::INFINITY),
                ("−∞", f32::NEG_INFINITY),
            ];
            for (shown, value) in values {
                // An infinite logit is an opacity of 0 or 1; −∞ as the logarithm of a scale is a scale of 0.
                let limit = name == "opacity" || (name == "scales" && value < 0.0);
                if limit && value.is_infinite() {
                    continue;
                }
                let case = format!("{shown} in {name} {}", column - first);
                not_drawn(&case, with(|it| it[column] = value));
            }
        }
    }
}

#[test]
fn colours_out_of_range() {
    let of = |colour: [f32; 3]| with(|it| it[COLOUR..].copy_from_slice(&colour));
    let view = view(16, 16);
    let million = of([1e6, -1e6, 1e6]);
    compare("colours of ±1e6", &[million, farther()], &view);
    compare("colours of ±1e30", &[of([1e30, -1e30, 1e30])], &view);
}

#[test]
fn pictures_of_one_pixel_and_of_one_row() {
    compare("a picture of 1 x 1", &[plain()], &view(1, 1));
    let far = with(|it| it[12] = -40.0);
    compare("a picture of 4096 x 1", &[plain(), far], &view(4096, 1));
}

/// A tile of a million equal splats that cover it: what is behind the first thousand can't be seen, and is not
/// computed. Closed form: 1 − (1 − α)ⁿ.
#[test]
fn a_million_splats_in_one_tile() {
    const COUNT: usize = 1_000_000;
    let view = view(16, 16);
    let towards = towards(&view);
    let wide = with(|it| {
        it[SCALES..OPACITY].fill(1e3f32.ln());
        it[OPACITY] = -4.0;
    });
    let found = run(&vec![wide; COUNT], &[0.0; 24], &view, &towards);
    let exact: Vec<f64> = [0.2, 0.5, 0.8, 1.0].repeat(256);
    // The bound is what the tile leaves out behind an opacity of 1 − 5e-4.
    show("10⁶ equal ones that cover a tile", &found, &exact, 5e-4);
    let learned = found.gradients.chunks(ROW);
    let learned = learned.filter(|row| row.iter().any(|v| *v != 0.0)).count();
    assert!((100..1000).contains(&learned), "{learned} were blended");

    // Splats of one pixel leave the rest of the tile clear, so all are blended.
    let small = with(|it| {
        it[12..15].copy_from_slice(&[0.01, 0.01, 2.0]);
        it[SCALES..OPACITY].fill(-20.0);
        it[OPACITY] = (MIN_ALPHA * 1.1 / (1.0 - MIN_ALPHA * 1.1)).ln();
    });
    let found = run(&vec![small; COUNT], &[0.0; 24], &view, &towards);
    let mut exact = vec![0.0; 4 * 256];
    // The centre is that of the pixel (8, 8).
    exact[4 * (8 * 16 + 8)..][..4].copy_from_slice(&[0.2, 0.5, 0.8, 1.0]);
    show("10⁶ equal ones at a pixel", &found, &exact, 2e-5);
}

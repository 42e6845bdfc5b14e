//! The comparison on a GPU. The window's means are computed by rows, then by columns; so there are two
//! passes up to the similarity of each pixel, and two for its slope.

use super::window::{HALF, TAPS, taps};
use super::{C1, C2, PictureLossOps, Target};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;

/// Threads of a group, which sum before they add to the sums of all. Every Vulkan device runs as many.
const GROUP: usize = 64;
/// Means that similarity needs: of the picture, the truth, their squares and their product.
const MEANS: usize = 5;
/// Slopes of similarity: to the mean, the mean square and the mean product.
const SLOPES: usize = 3;

impl PictureLossOps for CubeBackend {
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        compare(&rows(picture), &target)
    }

    fn picture_loss_backward(
        slope: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (slope, grad) = (rows(slope), rows(grad));
        let output = empty(&slope, slope.meta.shape().clone());
        let client = output.client.clone();
        let (count, dim) = each(&client, output.meta.num_elements());
        scale::launch(
            &client,
            count,
            dim,
            slope.into_buffer_arg(),
            grad.into_buffer_arg(),
            output.clone().into_buffer_arg(),
        );
        output
    }
}

/// The numbers of [`super::picture_loss`], and the slope of the first to the picture `[H W, 4]`.
fn compare(picture: &CubeTensor, target: &Target) -> (CubeTensor, CubeTensor) {
    let [width, height] = target.size();
    let (area, pixels) = (width * height, target.width * target.height);
    let client = picture.client.clone();
    let maps = |count| empty(picture, Shape::new([count, 3, area]));
    let window = || upload(&client, &taps());
    let truth = || upload(&client, &words(&target.rgb));
    let groups = |threads| {
        let dim = CubeDim::new_1d(GROUP as u32);
        (calculate_cube_count_elemwise(&client, threads, dim), dim)
    };
    let sums = zeros(picture, Shape::new([3]));

    let by_rows = maps(MEANS);
    let (count, dim) = each(&client, 3 * area);
    means_of_rows::launch(
        &client,
        count,
        dim,
        picture.clone().into_buffer_arg(),
        truth(),
        window(),
        by_rows.clone().into_buffer_arg(),
        region(target),
    );
    let slopes = maps(SLOPES);
    let (count, dim) = groups(3 * area);
    launch_adding!(
        similarity,
        &client,
        count,
        dim,
        by_rows.into_buffer_arg(),
        window(),
        slopes.clone().into_buffer_arg(),
        sums.clone().into_buffer_arg(),
        region(target),
    );
    let slopes_by_rows = maps(SLOPES);
    let (count, dim) = each(&client, 3 * area);
    slopes_of_rows::launch(
        &client,
        count,
        dim,
        slopes.into_buffer_arg(),
        window(),
        slopes_by_rows.clone().into_buffer_arg(),
        region(target),
    );
    let slope = empty(picture, Shape::new([pixels, 4]));
    let (count, dim) = groups(pixels);
    launch_adding!(
        slope_of_picture,
        &client,
        count,
        dim,
        picture.clone().into_buffer_arg(),
        truth(),
        upload(&client, &words(&target.mask)),
        slopes_by_rows.into_buffer_arg(),
        window(),
        slope.clone().into_buffer_arg(),
        sums.clone().into_buffer_arg(),
        region(target),
        weights(target),
    );
    let terms = empty(picture, Shape::new([4]));
    weigh::launch(
        &client,
        CubeCount::new_single(),
        CubeDim::new_1d(1),
        sums.into_buffer_arg(),
        terms.clone().into_buffer_arg(),
        region(target),
        weights(target),
    );
    (terms, slope)
}

/// Bytes, four in a number, the first one lowest.
fn words(bytes: &[u8]) -> Vec<u32> {
    let word = |part: &[u8]| {
        let bytes = part.iter().enumerate();
        bytes.fold(0, |word, (place, byte)| {
            word | u32::from(*byte) << (8 * place)
        })
    };
    bytes.chunks(4).map(word).collect()
}

/// Byte number `i` of [`words`], as a part of 255.
#[cube]
fn byte(words: &[u32], i: usize) -> f32 {
    let shift = 8 * (i % 4) as u32;
    f32::cast_from((words[i / 4] >> shift) & 255u32) / 255.0
}

/// The compared region of a picture.
#[derive(CubeType, CubeLaunch)]
struct Region {
    /// First column and row.
    left: u32,
    top: u32,
    width: u32,
    height: u32,
    /// Width of the whole picture.
    across: u32,
}

fn region(target: &Target) -> RegionLaunch {
    let [width, height] = target.size().map(|side| side as u32);
    let [left, top, ..] = target.region.map(|edge| edge as u32);
    RegionLaunch::new(left, top, width, height, target.width as u32)
}

/// As [`super::Weights`].
#[derive(CubeType, CubeLaunch)]
struct Shares {
    absolute: f32,
    ssim: f32,
    mask: f32,
}

fn weights(target: &Target) -> SharesLaunch {
    let weights = target.weights;
    SharesLaunch::new(weights.absolute, weights.ssim, weights.mask)
}

/// Number of the region's pixels.
#[cube]
fn area(region: &Region) -> usize {
    usize::cast_from(region.width * region.height)
}

/// Number in the whole picture of the pixel in column `x` and row `y` of the region.
#[cube]
fn pixel(x: u32, y: u32, region: &Region) -> usize {
    usize::cast_from((region.top + y) * region.across + region.left + x)
}

/// The means under the window of the row of a pixel, `[5, 3, A]`, a thread for each channel and pixel.
/// Outside of the region is black.
#[cube(launch)]
fn means_of_rows(
    picture: &[f32],
    truth: &[u32],
    window: &[f32],
    means: &mut [f32],
    region: &Region,
) {
    let area = area(region);
    let thread = ABSOLUTE_POS;
    if thread >= 3 * area {
        terminate!();
    }
    let channel = thread / area;
    let x = (thread % area) as u32 % region.width;
    let y = (thread % area) as u32 / region.width;
    let mut sums = Array::<f32>::new(MEANS);
    #[unroll]
    for m in 0..MEANS {
        sums[m] = 0.0;
    }
    for tap in 0..TAPS as u32 {
        // Wraps around left of the region.
        let column = x + tap - HALF as u32;
        if column < region.width {
            let pixel = pixel(column, y, region);
            let a = picture[4 * pixel + channel];
            let b = byte(truth, 3 * pixel + channel);
            let share = window[tap as usize];
            sums[0usize] += share * a;
            sums[1usize] += share * b;
            sums[2usize] += share * a * a;
            sums[3usize] += share * b * b;
            sums[4usize] += share * a * b;
        }
    }
    #[unroll]
    for m in 0..MEANS {
        means[m * 3 * area + thread] = sums[m];
    }
}

/// The mean under the window of a column of the map that begins at `map`.
#[cube]
fn mean_of_column(
    maps: &[f32],
    map: usize,
    x: u32,
    y: u32,
    window: &[f32],
    region: &Region,
) -> f32 {
    let mut sum = 0.0f32;
    for tap in 0..TAPS as u32 {
        // Wraps around above the region.
        let row = y + tap - HALF as u32;
        if row < region.height {
            sum += window[tap as usize] * maps[map + (row * region.width + x) as usize];
        }
    }
    sum
}

/// Adds the sum over the group of `value` to `sum`.
#[cube]
fn add_of_group<A: AddFloat>(value: f32, sum: &mut Atomic<Bound<A>>) {
    let unit = UNIT_POS as usize;
    let mut shared = Shared::<[f32]>::new_slice(GROUP);
    shared[unit] = value;
    sync_cube();
    if unit == 0 {
        let mut total = 0.0f32;
        for i in 0..GROUP {
            total += shared[i];
        }
        A::add(sum, total);
    }
}

/// The slopes of SSIM at a pixel to its means, `[3, 3, A]`, and 1 − SSIM added to `sums[1]`.
#[cube(launch)]
fn similarity<A: AddFloat>(
    means: &[f32],
    window: &[f32],
    slopes: &mut [f32],
    sums: &mut [Atomic<Bound<A>>],
    region: &Region,
) {
    let area = area(region);
    let thread = ABSOLUTE_POS;
    let mut unlike = 0.0f32;
    if thread < 3 * area {
        let channel = thread / area;
        let x = (thread % area) as u32 % region.width;
        let y = (thread % area) as u32 / region.width;
        let mut mean = Array::<f32>::new(MEANS);
        #[unroll]
        for m in 0..MEANS {
            mean[m] = mean_of_column(means, (3 * m + channel) * area, x, y, window, region);
        }
        let a = mean[0usize];
        let b = mean[1usize];
        let even = (mean[2usize] - a * a) + (mean[3usize] - b * b) + C2;
        let together = mean[4usize] - a * b;
        let bright = (2.0 * a * b + C1) / (a * a + b * b + C1);
        let structure = (2.0 * together + C2) / even;
        unlike = 1.0 - bright * structure;
        let to_together = 2.0 * bright / even;
        let to_spread = -bright * structure / even;
        let to_bright = 2.0 * (b - bright * a) / (a * a + b * b + C1);
        slopes[thread] = structure * to_bright - 2.0 * a * to_spread - b * to_together;
        slopes[3 * area + thread] = to_spread;
        slopes[6 * area + thread] = to_together;
    }
    add_of_group::<A>(unlike, &mut sums[1]);
}

/// Maps `[3, 3, A]` under the window of each pixel's row.
#[cube(launch)]
fn slopes_of_rows(maps: &[f32], window: &[f32], output: &mut [f32], region: &Region) {
    let area = area(region);
    let thread = ABSOLUTE_POS;
    if thread >= 3 * area {
        terminate!();
    }
    let x = (thread % area) as u32 % region.width;
    #[unroll]
    for m in 0..SLOPES {
        let first = m * 3 * area + thread - x as usize;
        let mut sum = 0.0f32;
        for tap in 0..TAPS as u32 {
            // Wraps around left of the region.
            let column = x + tap - HALF as u32;
            if column < region.width {
                sum += window[tap as usize] * maps[first + column as usize];
            }
        }
        output[m * 3 * area + thread] = sum;
    }
}

/// The slope of the weighted loss `[H W, 4]`, a thread for each pixel of the picture; absolute
/// differences added to `sums[0]`, those between opacity and mask to `sums[2]`.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn slope_of_picture<A: AddFloat>(
    picture: &[f32],
    truth: &[u32],
    mask: &[u32],
    maps: &[f32],
    window: &[f32],
    slope: &mut [f32],
    sums: &mut [Atomic<Bound<A>>],
    region: &Region,
    weights: &Shares,
) {
    let area = area(region);
    let at = ABSOLUTE_POS;
    let mut absolute = 0.0f32;
    let mut off_mask = 0.0f32;
    if at < slope.len() / 4 {
        let share = 1.0 / (3.0 * f32::cast_from(area));
        // Wraps around left of the region and above it.
        let x = at as u32 % region.across - region.left;
        let y = at as u32 / region.across - region.top;
        for c in 0..3usize {
            let mut to = 0.0f32;
            if x < region.width && y < region.height {
                let a = picture[4 * at + c];
                let b = byte(truth, 3 * at + c);
                let map = c * area;
                let by_mean = mean_of_column(maps, map, x, y, window, region);
                let by_square = mean_of_column(maps, map + 3 * area, x, y, window, region);
                let by_product = mean_of_column(maps, map + 6 * area, x, y, window, region);
                let off = a - b;
                // The derivative of |off|, 0 where it has none.
                let mut sign = 0.0f32;
                if off > 0.0 {
                    sign = 1.0;
                } else if off < 0.0 {
                    sign = -1.0f32;
                }
                absolute += f32::abs(off);
                let to_similarity = by_mean + 2.0 * a * by_square + b * by_product;
                to = share * (weights.absolute * sign - weights.ssim * to_similarity);
            }
            slope[4 * at + c] = to;
        }
        let coverage = byte(mask, at);
        let trust = f32::abs(2.0 * coverage - 1.0);
        let off = picture[4 * at + 3] - coverage;
        off_mask = trust * off * off;
        slope[4 * at + 3] = weights.mask * 2.0 * trust * off / f32::cast_from(area);
    }
    add_of_group::<A>(absolute, &mut sums[0]);
    add_of_group::<A>(off_mask, &mut sums[2]);
}

/// The numbers of [`super::picture_loss`] from the sums over all pixels.
#[cube(launch)]
fn weigh(sums: &[f32], terms: &mut [f32], region: &Region, weights: &Shares) {
    let area = f32::cast_from(area(region));
    let absolute = sums[0] / (3.0 * area);
    let unlike = sums[1] / (3.0 * area);
    let off_mask = sums[2] / area;
    terms[0] = weights.absolute * absolute + weights.ssim * unlike + weights.mask * off_mask;
    terms[1] = absolute;
    terms[2] = unlike;
    terms[3] = off_mask;
}

/// `slope` times the first of the numbers `grad`.
#[cube(launch)]
fn scale(slope: &[f32], grad: &[f32], output: &mut [f32]) {
    if ABSOLUTE_POS >= output.len() {
        terminate!();
    }
    output[ABSOLUTE_POS] = slope[ABSOLUTE_POS] * grad[0];
}

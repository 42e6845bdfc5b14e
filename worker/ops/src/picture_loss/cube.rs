//! The loss on a GPU. The means under the window are computed by rows, then by columns, so that there are two
//! passes for the SSIM of each pixel and two for its gradient.

use super::window::{RADIUS, TAPS, taps};
use super::{C1, C2, PictureLossOps, Target};
use crate::cube::adding::{AddFloat, Bound, launch_adding};
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;

/// Threads per group, of which every Vulkan device runs this many. A group sums before it adds to the sums of all
/// groups.
const GROUP: usize = 64;
/// Means that SSIM needs: of the picture a, the truth b, a², b² and a b.
const MEANS: usize = 5;
/// Gradients of SSIM: to the means of a, a² and a b.
const GRADIENTS: usize = 3;

impl PictureLossOps for CubeBackend {
    fn picture_loss(
        picture: FloatTensor<Self>,
        target: Target,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        compare(&rows(picture), &target)
    }

    fn picture_loss_backward(
        gradient: FloatTensor<Self>,
        grad: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        let (gradient, grad) = (rows(gradient), rows(grad));
        let output = empty(&gradient, gradient.meta.shape().clone());
        let client = output.client.clone();
        let (count, dim) = each(&client, output.meta.num_elements());
        scale::launch(
            &client,
            count,
            dim,
            gradient.into_buffer_arg(),
            grad.into_buffer_arg(),
            output.clone().into_buffer_arg(),
        );
        output
    }
}

/// The numbers of [`super::picture_loss`], and the gradient of the first with respect to the picture `[H W, 4]`.
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
    let gradients = maps(GRADIENTS);
    let (count, dim) = groups(3 * area);
    launch_adding!(
        similarity,
        &client,
        count,
        dim,
        by_rows.into_buffer_arg(),
        window(),
        gradients.clone().into_buffer_arg(),
        sums.clone().into_buffer_arg(),
        region(target),
    );
    let gradients_by_rows = maps(GRADIENTS);
    let (count, dim) = each(&client, 3 * area);
    gradients_of_rows::launch(
        &client,
        count,
        dim,
        gradients.into_buffer_arg(),
        window(),
        gradients_by_rows.clone().into_buffer_arg(),
        region(target),
    );
    let gradient = empty(picture, Shape::new([pixels, 4]));
    let (count, dim) = groups(pixels);
    launch_adding!(
        gradient_of_picture,
        &client,
        count,
        dim,
        picture.clone().into_buffer_arg(),
        truth(),
        upload(&client, &words(&target.mask)),
        gradients_by_rows.into_buffer_arg(),
        window(),
        gradient.clone().into_buffer_arg(),
        sums.clone().into_buffer_arg(),
        region(target),
        weights(target),
    );
    let terms = empty(picture, Shape::new([4]));
    weighted_terms::launch(
        &client,
        CubeCount::new_single(),
        CubeDim::new_1d(1),
        sums.into_buffer_arg(),
        terms.clone().into_buffer_arg(),
        region(target),
        weights(target),
    );
    (terms, gradient)
}

/// Bytes packed into words of four, the first byte lowest.
fn words(bytes: &[u8]) -> Vec<u32> {
    let word = |part: &[u8]| {
        let bytes = part.iter().enumerate();
        bytes.fold(0, |word, (index, byte)| {
            word | u32::from(*byte) << (8 * index)
        })
    };
    bytes.chunks(4).map(word).collect()
}

/// The byte with index `i` of [`words`], divided by 255.
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

/// [`super::Weights`] in a kernel.
#[derive(CubeType, CubeLaunch)]
struct TermWeights {
    absolute: f32,
    ssim: f32,
    mask: f32,
}

fn weights(target: &Target) -> TermWeightsLaunch {
    let weights = target.weights;
    TermWeightsLaunch::new(weights.absolute, weights.ssim, weights.mask)
}

/// Number of pixels of the region.
#[cube]
fn area(region: &Region) -> usize {
    usize::cast_from(region.width * region.height)
}

/// Index in the whole picture of the pixel in column `x` and row `y` of the region.
#[cube]
fn pixel(x: u32, y: u32, region: &Region) -> usize {
    usize::cast_from((region.top + y) * region.across + region.left + x)
}

/// Writes the means under the window along the row of each pixel, `[5, 3, A]`. A thread per channel and pixel.
/// Outside of the region, pictures are black.
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
        let column = x + tap - RADIUS as u32;
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

/// The mean under the window along a column of the map that begins at `map`.
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
        let row = y + tap - RADIUS as u32;
        if row < region.height {
            sum += window[tap as usize] * maps[map + (row * region.width + x) as usize];
        }
    }
    sum
}

/// Adds the sum of `value` over the group to `sum`.
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

/// Writes the gradients of SSIM at each pixel to its means, `[3, 3, A]`, and adds 1 − SSIM to `sums[1]`. The
/// equations are those of `similarity` in `cpu`.
#[cube(launch)]
fn similarity<A: AddFloat>(
    means: &[f32],
    window: &[f32],
    gradients: &mut [f32],
    sums: &mut [Atomic<Bound<A>>],
    region: &Region,
) {
    let area = area(region);
    let thread = ABSOLUTE_POS;
    let mut dissimilarity = 0.0f32;
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
        let variances = (mean[2usize] - a * a) + (mean[3usize] - b * b) + C2;
        let covariance = mean[4usize] - a * b;
        // SSIM = l s with l = (2 μₐ μ_b + C₁) / (μₐ² + μ_b² + C₁), s = (2 σₐ_b + C₂) / (σₐ² + σ_b² + C₂)
        let luminance = (2.0 * a * b + C1) / (a * a + b * b + C1);
        let structure = (2.0 * covariance + C2) / variances;
        dissimilarity = 1.0 - luminance * structure;
        // ∂SSIM/∂σₐ_b, ∂SSIM/∂σₐ², ∂l/∂μₐ
        let to_covariance = 2.0 * luminance / variances;
        let to_variance = -luminance * structure / variances;
        let to_luminance = 2.0 * (b - luminance * a) / (a * a + b * b + C1);
        gradients[thread] = structure * to_luminance - 2.0 * a * to_variance - b * to_covariance;
        gradients[3 * area + thread] = to_variance;
        gradients[6 * area + thread] = to_covariance;
    }
    add_of_group::<A>(dissimilarity, &mut sums[1]);
}

/// Writes the means of the maps `[3, 3, A]` under the window along each pixel's row.
#[cube(launch)]
fn gradients_of_rows(maps: &[f32], window: &[f32], output: &mut [f32], region: &Region) {
    let area = area(region);
    let thread = ABSOLUTE_POS;
    if thread >= 3 * area {
        terminate!();
    }
    let x = (thread % area) as u32 % region.width;
    #[unroll]
    for m in 0..GRADIENTS {
        let first = m * 3 * area + thread - x as usize;
        let mut sum = 0.0f32;
        for tap in 0..TAPS as u32 {
            // Wraps around left of the region.
            let column = x + tap - RADIUS as u32;
            if column < region.width {
                sum += window[tap as usize] * maps[first + column as usize];
            }
        }
        output[m * 3 * area + thread] = sum;
    }
}

/// Writes the gradient of the weighted loss `[H W, 4]`, and adds absolute differences to `sums[0]` and those between
/// opacity and mask to `sums[2]`. A thread per pixel of the picture.
#[cube(launch)]
#[allow(clippy::too_many_arguments)]
fn gradient_of_picture<A: AddFloat>(
    picture: &[f32],
    truth: &[u32],
    mask: &[u32],
    maps: &[f32],
    window: &[f32],
    gradient: &mut [f32],
    sums: &mut [Atomic<Bound<A>>],
    region: &Region,
    weights: &TermWeights,
) {
    let area = area(region);
    let at = ABSOLUTE_POS;
    let mut absolute = 0.0f32;
    let mut mask_error = 0.0f32;
    if at < gradient.len() / 4 {
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
                let difference = a - b;
                // The derivative of |d|, and 0 at d = 0.
                let mut sign = 0.0f32;
                if difference > 0.0 {
                    sign = 1.0;
                } else if difference < 0.0 {
                    sign = -1.0f32;
                }
                absolute += f32::abs(difference);
                let to_similarity = by_mean + 2.0 * a * by_square + b * by_product;
                to = share * (weights.absolute * sign - weights.ssim * to_similarity);
            }
            gradient[4 * at + c] = to;
        }
        // w (α − m)² with w = |2 m − 1|
        let coverage = byte(mask, at);
        let confidence = f32::abs(2.0 * coverage - 1.0);
        let difference = picture[4 * at + 3] - coverage;
        mask_error = confidence * difference * difference;
        gradient[4 * at + 3] = weights.mask * 2.0 * confidence * difference / f32::cast_from(area);
    }
    add_of_group::<A>(absolute, &mut sums[0]);
    add_of_group::<A>(mask_error, &mut sums[2]);
}

/// Writes the numbers of the operation `picture_loss` from the sums over all pixels.
#[cube(launch)]
fn weighted_terms(sums: &[f32], terms: &mut [f32], region: &Region, weights: &TermWeights) {
    let area = f32::cast_from(area(region));
    let absolute = sums[0] / (3.0 * area);
    let dissimilarity = sums[1] / (3.0 * area);
    let mask_error = sums[2] / area;
    terms[0] =
        weights.absolute * absolute + weights.ssim * dissimilarity + weights.mask * mask_error;
    terms[1] = absolute;
    terms[2] = dissimilarity;
    terms[3] = mask_error;
}

/// Writes `gradient` times `grad[0]`.
#[cube(launch)]
fn scale(gradient: &[f32], grad: &[f32], output: &mut [f32]) {
    if ABSOLUTE_POS >= output.len() {
        terminate!();
    }
    output[ABSOLUTE_POS] = gradient[ABSOLUTE_POS] * grad[0];
}

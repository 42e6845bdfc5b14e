//! Single pixels of a picture, and their gradients to the transforms of the splats.

use super::cpu::{ProjectBackward, SplatSlices};
use super::light::LIGHTS;
use super::projected::Projected;
use super::projected_backward::ProjectedGradient;
use super::rasterize::OPAQUE;
use super::tiles::{SIDE, Tiles};
use super::{MAX_ALPHA, MIN_ALPHA, View};
use crate::form::Form;

/// Power below which even an opaque splat has less than [`MIN_ALPHA`], ln(1/255) = −5.541: most splats of a tile do not
/// reach a given pixel.
const FAINT: f32 = -5.55;

/// A picture of which single pixels are computed.
pub struct Probe<'a> {
    slices: SplatSlices<'a>,
    light: [[f32; LIGHTS]; 3],
    view: &'a View,
    projected: Vec<Projected>,
    tiles: Tiles,
}

/// A splat at a pixel.
struct Layer {
    /// Index of the splat.
    splat: usize,
    /// Offset from its centre to the pixel's, pixels.
    offset: [f32; 2],
    alpha: f32,
    /// Transmittance in front of it.
    transmittance: f32,
}

/// The gradient of a pixel to the transform of one splat.
pub struct TransformGradient {
    /// Index of the splat.
    pub splat: usize,
    /// Row-major 3x4.
    pub to_transform: [f32; 12],
}

impl<'a> Probe<'a> {
    /// The picture of splats.
    pub fn new(slices: SplatSlices<'a>, view: &'a View) -> Self {
        let projected = slices.projected(view);
        Self {
            light: slices.light(),
            tiles: Tiles::new(&projected, view.width, view.height),
            slices,
            view,
            projected,
        }
    }

    /// Number of splats.
    pub fn splats(&self) -> usize {
        self.projected.len()
    }

    /// Σ α over the pixels of a splat that nothing hides, 2π o / √det Σ'⁻¹, pixels.
    pub fn footprint(&self, splat: usize) -> f32 {
        let projected = &self.projected[splat];
        let [xx, xy, yy] = projected.conic;
        let det = (xx * yy - xy * xy).max(f32::MIN_POSITIVE);
        std::f32::consts::TAU * projected.opacity / det.sqrt()
    }

    /// The canonical mean of a splat, metres.
    pub fn mean(&self, splat: usize) -> [f32; 3] {
        self.slices.splat(splat).mean
    }

    /// Depth of a splat's mean, metres.
    pub fn depth(&self, splat: usize) -> f32 {
        self.projected[splat].depth
    }

    /// Red, green and blue over black, and opacity, of a pixel. Pixels are numbered row by row.
    pub fn pixel(&self, pixel: usize) -> [f32; 4] {
        let mut sum = [0f32; 4];
        for layer in self.layers(pixel) {
            // C = Σ T α c
            let weight = layer.transmittance * layer.alpha;
            let [r, g, b] = self.projected[layer.splat].colour;
            for (sum, value) in sum.iter_mut().zip([r, g, b, 1.0]) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// Depth in metres, opacity α and colour of each splat at a pixel, near to far.
    pub fn splats_at(&self, pixel: usize) -> impl Iterator<Item = (f32, f32, [f32; 3])> {
        self.layers(pixel).into_iter().map(move |layer| {
            let projected = &self.projected[layer.splat];
            (projected.depth, layer.alpha, projected.colour)
        })
    }

    /// The splats at a pixel, near to far, and the weight T α of each.
    pub fn weights_at(&self, pixel: usize) -> Vec<(usize, f32)> {
        let layers = self.layers(pixel).into_iter();
        layers
            .map(|layer| (layer.splat, layer.transmittance * layer.alpha))
            .collect()
    }

    /// The sum of red, green, blue and opacity of a pixel times `weights`, and the gradients of that sum to the
    /// transforms of the splats at the pixel.
    pub fn gradients(&self, pixel: usize, weights: [f32; 4]) -> (f32, Vec<TransformGradient>) {
        let layers = self.layers(pixel);
        let [red, green, blue, opacity] = weights;
        // As in rasterize_backward: v = ∂L/∂C · (c, 1).
        let own = |layer: &Layer| {
            let [r, g, b] = self.projected[layer.splat].colour;
            red * r + green * g + blue * b + opacity
        };
        let weight = |layer: &Layer| layer.transmittance * layer.alpha;
        let value = layers.iter().map(|layer| weight(layer) * own(layer)).sum();
        let mut behind: f32 = value;
        let gradients = layers.iter().map(|layer| {
            let (own, weight) = (own(layer), weight(layer));
            behind -= weight * own;
            // ∂L/∂p = α (T v − B / (1 − α)) with B = Σ T α v of the splats behind; 0 where α is clamped
            let to_power = if layer.alpha < MAX_ALPHA {
                layer.alpha * (layer.transmittance * own - behind / (1.0 - layer.alpha))
            } else {
                0.0
            };
            let [dx, dy] = layer.offset;
            let (px, py) = (to_power * dx, to_power * dy);
            let [xx, xy, yy] = self.projected[layer.splat].conic;
            let to = ProjectedGradient {
                // p = −(xx dx² + 2 xy dx dy + yy dy²) / 2 with d = pixel − centre
                centre: [xx * px + xy * py, xy * px + yy * py],
                conic: [-0.5 * px * dx, -px * dy, -0.5 * py * dy],
                opacity: 0.0,
                colour: [red, green, blue].map(|by| weight * by),
            };
            TransformGradient {
                splat: layer.splat,
                to_transform: Form::best()
                    .run(ProjectBackward {
                        splat: self.slices.splat(layer.splat),
                        light: &self.light,
                        view: self.view,
                        to: &to,
                    })
                    .transform,
            }
        });
        let gradients = gradients.collect();
        (value, gradients)
    }

    /// The splats at a pixel, near to far.
    fn layers(&self, pixel: usize) -> Vec<Layer> {
        let (x, y) = (pixel % self.view.width, pixel / self.view.width);
        let mut transmittance = 1.0;
        let mut layers = Vec::new();
        for entry in self.tiles.of(y / SIDE * self.tiles.across + x / SIDE) {
            let splat = *entry as usize;
            let projected = &self.projected[splat];
            let [dx, dy] = [x, y].map(|v| v as f32 + 0.5);
            let [dx, dy] = [dx - projected.centre[0], dy - projected.centre[1]];
            let [xx, xy, yy] = projected.conic;
            // α = min(o exp(−dᵀ Σ'⁻¹ d / 2), MAX_ALPHA)
            let power = -0.5 * (xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy);
            if power < FAINT {
                continue;
            }
            let alpha = (projected.opacity * power.min(0.0).exp()).min(MAX_ALPHA);
            if alpha >= MIN_ALPHA {
                layers.push(Layer {
                    splat,
                    offset: [dx, dy],
                    alpha,
                    transmittance,
                });
                transmittance *= 1.0 - alpha;
            }
            if transmittance < OPAQUE {
                break;
            }
        }
        layers
    }
}

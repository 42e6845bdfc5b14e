//! Single pixels of a picture, and how each changes with the transforms of its splats.

use super::cpu::{Numbers, Unflatten};
use super::flat::{Flat, FlatGradient};
use super::light::LIGHTS;
use super::raster::OPAQUE;
use super::tiles::{SIDE, Tiles};
use super::{LEAST, MOST, Sight};
use crate::form::Form;

/// A picture that is asked pixel by pixel.
pub struct Probe<'a> {
    numbers: Numbers<'a>,
    light: [[f32; LIGHTS]; 3],
    sight: &'a Sight,
    flats: Vec<Flat>,
    tiles: Tiles,
}

/// A splat at a pixel.
struct Layer {
    splat: usize,
    /// From its centre to the pixel's, pixels.
    offset: [f32; 2],
    alpha: f32,
    /// Transmittance in front of it.
    through: f32,
}

/// The gradient of a pixel to the transform of a splat.
pub struct SplatPull {
    /// Index of the splat.
    pub splat: usize,
    /// Row-major 3x4.
    pub to_transform: [f32; 12],
}

impl<'a> Probe<'a> {
    /// The picture of splats.
    pub fn new(numbers: Numbers<'a>, sight: &'a Sight) -> Self {
        let flats = numbers.flats(sight);
        Self {
            light: numbers.light(),
            tiles: Tiles::new(&flats, sight.width, sight.height),
            numbers,
            sight,
            flats,
        }
    }

    /// Number of splats.
    pub fn splats(&self) -> usize {
        self.flats.len()
    }

    /// The canonical place of a splat, metres.
    pub fn place(&self, splat: usize) -> [f32; 3] {
        self.numbers.splat(splat).mean
    }

    /// Red, green, blue over black and opacity of the pixel with the number `pixel`.
    pub fn pixel(&self, pixel: usize) -> [f32; 4] {
        let mut sum = [0f32; 4];
        for layer in self.layers(pixel) {
            let weight = layer.through * layer.alpha;
            let [r, g, b] = self.flats[layer.splat].colour;
            for (sum, value) in sum.iter_mut().zip([r, g, b, 1.0]) {
                *sum += weight * value;
            }
        }
        sum
    }

    /// Depth, metres, opacity and colour of each splat at a pixel, near to far.
    pub fn met(&self, pixel: usize) -> impl Iterator<Item = (f32, f32, [f32; 3])> {
        self.layers(pixel).into_iter().map(move |layer| {
            let flat = &self.flats[layer.splat];
            (flat.depth, layer.alpha, flat.colour)
        })
    }

    /// The splats at a pixel, and the part of it that each has.
    pub fn parts(&self, pixel: usize) -> Vec<(usize, f32)> {
        let layers = self.layers(pixel).into_iter();
        layers
            .map(|layer| (layer.splat, layer.through * layer.alpha))
            .collect()
    }

    /// The sum of a pixel's red, green, blue and opacity times `weights`, and its gradients.
    pub fn pulls(&self, pixel: usize, weights: [f32; 4]) -> (f32, Vec<SplatPull>) {
        let layers = self.layers(pixel);
        let [red, green, blue, opacity] = weights;
        let own = |layer: &Layer| {
            let [r, g, b] = self.flats[layer.splat].colour;
            red * r + green * g + blue * b + opacity
        };
        let weight = |layer: &Layer| layer.through * layer.alpha;
        let value = layers.iter().map(|it| weight(it) * own(it)).sum();
        let mut behind: f32 = value;
        let pulls = layers.iter().map(|layer| {
            let (own, weight) = (own(layer), weight(layer));
            behind -= weight * own;
            // Where opacity is cut off, it does not change.
            let to_power = if layer.alpha < MOST {
                layer.alpha * (layer.through * own - behind / (1.0 - layer.alpha))
            } else {
                0.0
            };
            let [dx, dy] = layer.offset;
            let (px, py) = (to_power * dx, to_power * dy);
            let [xx, xy, yy] = self.flats[layer.splat].conic;
            let to = FlatGradient {
                // The exponent is −(xx dx² + 2 xy dx dy + yy dy²) / 2.
                centre: [xx * px + xy * py, xy * px + yy * py],
                conic: [-0.5 * px * dx, -px * dy, -0.5 * py * dy],
                opacity: 0.0,
                colour: [red, green, blue].map(|by| weight * by),
            };
            SplatPull {
                splat: layer.splat,
                to_transform: Form::best()
                    .run(Unflatten {
                        splat: self.numbers.splat(layer.splat),
                        light: &self.light,
                        sight: self.sight,
                        to: &to,
                    })
                    .transform,
            }
        });
        let pulls = pulls.collect();
        (value, pulls)
    }

    /// The splats at a pixel, near to far.
    fn layers(&self, pixel: usize) -> Vec<Layer> {
        let (x, y) = (pixel % self.sight.width, pixel / self.sight.width);
        let mut through = 1.0;
        let mut layers = Vec::new();
        for entry in self.tiles.of(y / SIDE * self.tiles.across + x / SIDE) {
            let splat = *entry as usize;
            let flat = &self.flats[splat];
            let [dx, dy] = [x, y].map(|v| v as f32 + 0.5);
            let [dx, dy] = [dx - flat.centre[0], dy - flat.centre[1]];
            let [xx, xy, yy] = flat.conic;
            let power = -0.5 * (xx * dx * dx + 2.0 * xy * dx * dy + yy * dy * dy);
            let alpha = (flat.opacity * power.min(0.0).exp()).min(MOST);
            if alpha >= LEAST {
                layers.push(Layer {
                    splat,
                    offset: [dx, dy],
                    alpha,
                    through,
                });
                through *= 1.0 - alpha;
            }
            if through < OPAQUE {
                break;
            }
        }
        layers
    }
}

//! The canonical field (HumanNeRF's, with the paper's identity codes): colour and density of all
//! people, distinguished by their identity codes and, with the hash encoding, by their tables
//! (`field/tables.rs`).

use super::mlp::{Mlp, MlpShape};
use super::tables::{self, Tables};
use crate::config::{CanonicalConfig, DensityActivation, Encoding, Precision};
use crate::identity::blend::Blend;
use crate::init::Initial;
use burn::module::{Module, Param};
use burn::tensor::Tensor;
use burn::tensor::activation::{relu, sigmoid, softplus};
use yoto_ops::encode::Bands;
use yoto_ops::hash::HashGrid;
use yoto_ops::mlp::Input;

/// Colour and density over canonical space.
#[derive(Module, Debug)]
pub struct Canonical {
    /// One `[rows, F]` per identity; none with the Fourier encoding.
    tables: Vec<Param<Tensor<2>>>,
    /// `[rows, F]`: the entries that all identities share; none with the Fourier encoding.
    shared: Option<Param<Tensor<2>>>,
    mlp: Mlp,
}

/// Values of the field at some points.
pub struct FieldValues {
    /// `[N, 3]`, metres: canonical points at which the field was evaluated.
    pub points: Tensor<2>,
    /// `[N, 3]` in [0, 1].
    pub rgb: Tensor<2>,
    /// `[N]`, 1/m.
    pub density: Tensor<1>,
}

impl Canonical {
    /// Appends an identity that is a mixture of two others.
    pub(crate) fn append(&mut self, blend: &Blend) {
        blend.append(&mut self.tables);
    }

    /// Sets the precision that the network multiplies in.
    pub(crate) fn set_precision(&mut self, precision: Precision) {
        self.mlp.set_precision(precision);
    }

    pub(crate) fn new(
        init: &Initial,
        config: &CanonicalConfig,
        slots: usize,
        code_width: usize,
        grid: Option<&HashGrid>,
        precision: Precision,
    ) -> Self {
        let input = match config.encoding {
            Encoding::Fourier { bands } => 3 + 6 * bands,
            Encoding::Hash {
                levels, features, ..
            } => levels * features,
        };
        let tables = Tables::new(init, "canonical", &config.encoding, grid, slots);
        let codes: &[_] = if code_width > 0 {
            &[(config.layers.inject, code_width)]
        } else {
            &[]
        };
        let shape = MlpShape {
            path: "canonical",
            input,
            width: config.layers.width,
            depth: config.layers.depth,
            skip: config.layers.skip,
            codes,
            output: 4,
            output_bound: None,
            precision,
        };
        Self {
            tables: tables.own,
            shared: tables.shared,
            mlp: Mlp::new(init, &shape),
        }
    }

    /// Values at canonical `points` `[N, 3]`, metres, of the identity in `slot`. `grid` is the
    /// hash grid over the identity's canonical box.
    ///
    /// # Panics
    /// If the identity has no table, or the encoding is a hash grid and `grid` is absent.
    pub fn forward(
        &self,
        config: &CanonicalConfig,
        points: Tensor<2>,
        slot: usize,
        grid: Option<&HashGrid>,
        code: Option<Tensor<1>>,
    ) -> FieldValues {
        let asked = points.clone();
        let (input, kind) = match config.encoding {
            Encoding::Fourier { bands } => {
                let kind = Input::Frequencies {
                    bands: Bands::new(bands, 1.0),
                    raw: true,
                };
                (points, kind)
            }
            Encoding::Hash { own_log2_rows, .. } => {
                let grid = grid.expect("a hash encoding comes with a grid");
                let own = &grid.within(own_log2_rows);
                let features = tables::encode(self.shared(), points.clone(), grid)
                    + tables::encode(&self.tables[slot], points, own);
                let [_, width] = features.dims();
                (features, Input::Features { width })
            }
        };
        let codes: Vec<_> = code
            .into_iter()
            .map(|code| (config.layers.inject, code))
            .collect();
        let raw = self.mlp.forward(input, kind, &codes);
        let [n, _] = raw.dims();
        let last = raw.clone().slice([0..n, 3..4]).reshape([n]);
        let density = match config.activation {
            DensityActivation::Softplus => softplus(last - 1.0, 1.0),
            DensityActivation::Relu => relu(last),
        };
        FieldValues {
            points: asked,
            rgb: sigmoid(raw.slice([0..n, 0..3])),
            density: density * config.density_scale,
        }
    }

    /// The entries that all identities share.
    fn shared(&self) -> &Param<Tensor<2>> {
        self.shared
            .as_ref()
            .expect("a hash encoding comes with a shared table")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Appearance, FieldConfig, ModelConfig};
    use crate::host::read;
    use crate::motion::body::hash_grid;
    use burn::tensor::Device;
    use yoto_ops::warp::WarpGrid;

    /// The values of a field of two identities with codes and tables, with or without its grid and code.
    fn evaluate(slot: usize, with_grid: bool, with_code: bool) -> FieldValues {
        let device = Device::flex();
        let config = ModelConfig::named("draft", "yoto").expect("a tier");
        let Appearance::Field(FieldConfig { canonical, .. }) = &config.appearance else {
            panic!("the tier has a field");
        };
        let config = canonical;
        let area = WarpGrid {
            min: [0.0; 3],
            max: [1.0; 3],
            nodes: [2; 3],
            floor: 0.0,
        };
        let grid = hash_grid(&config.encoding, &area);
        let init = Initial::new(&device, 1);
        let field = Canonical::new(&init, config, 2, 8, grid.as_ref(), Precision::F32);
        let points = Tensor::<2>::ones([1, 3], &device) * 0.5;
        let code = with_code.then(|| Tensor::zeros([8], &device));
        let grid = grid.filter(|_| with_grid);
        field.forward(config, points, slot, grid.as_ref(), code)
    }

    #[test]
    fn a_field_with_all_its_inputs_has_a_colour_and_a_density() {
        let [first, second] = [0, 1].map(|slot| {
            let values = evaluate(slot, true, true);
            let mut numbers = read(values.rgb).expect("reads");
            assert!(numbers.len() == 3 && numbers.iter().all(|v| *v > 0.0 && *v < 1.0));
            numbers.extend(read(values.density).expect("reads"));
            assert!(numbers.len() == 4 && numbers[3] > 0.0, "{numbers:?}");
            numbers
        });
        assert_ne!(first, second, "each identity has a table of its own");
    }

    #[test]
    #[should_panic(expected = "a hash encoding comes with a grid")]
    fn a_missing_grid_is_an_error() {
        evaluate(1, false, true);
    }

    #[test]
    #[should_panic(expected = "received none")]
    fn a_missing_code_is_an_error() {
        evaluate(1, true, false);
    }
}

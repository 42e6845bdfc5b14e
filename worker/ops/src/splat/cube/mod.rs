//! Splatting on a GPU: a thread for each splat, then a group of threads for each tile, and back.
//!
//! Between the two, the projected splats are read into host memory, where they are sorted and listed by
//! tile as on the CPU. For the 20,000 splats of a person that is a megabyte and about a millisecond, and
//! a training step reads the loss from the device anyway; sorting on the device would need a list of a
//! size that only the device knows. The backward pass projects and lists them again.

mod blend;
mod flatten;
mod lift;
mod strip;
mod unblend;
mod unflatten;
mod vectors;

use super::flat::Flat;
use super::light::LIGHTS;
use super::tiles::Tiles;
use super::{ROW, Sight, SplatOps};
use crate::cube::adding::launch_adding;
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use blend::blend_tiles;
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;
use flatten::{FLAT, flatten_splats};
use strip::THREADS;
use unblend::{SUMS, unblend_tiles};
use unflatten::{GROUP, unflatten_splats};

impl SplatOps for CubeBackend {
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        sight: Sight,
    ) -> FloatTensor<Self> {
        forward(&Inputs::new(transforms, rows, light), &sight)
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        sight: Sight,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        backward(&Inputs::new(transforms, rows, light), picture, grad, &sight)
    }
}

/// The inputs of the operation, in its order.
struct Inputs {
    transforms: CubeTensor,
    rows: CubeTensor,
    light: CubeTensor,
    client: Client,
}

impl Inputs {
    fn new(transforms: CubeTensor, splats: CubeTensor, light: CubeTensor) -> Self {
        Self {
            client: splats.client.clone(),
            transforms: rows(transforms),
            rows: rows(splats),
            light: rows(light),
        }
    }

    fn count(&self) -> usize {
        self.rows.meta.shape()[0]
    }

    /// The splats in the picture.
    fn flattened(&self, sight: &Sight) -> Flattened {
        let n = self.count();
        let flats = empty(&self.rows, Shape::new([n, FLAT]));
        if n > 0 {
            let (count, dim) = each(&self.client, n);
            flatten_splats::launch(
                &self.client,
                count,
                dim,
                self.transforms.clone().into_buffer_arg(),
                self.rows.clone().into_buffer_arg(),
                self.light.clone().into_buffer_arg(),
                upload(&self.client, &lift::numbers(sight)),
                flats.clone().into_buffer_arg(),
            );
        }
        let tiles = Tiles::new(&host(&flats), sight.width, sight.height);
        Flattened { flats, tiles }
    }
}

/// Splats in the picture.
struct Flattened {
    /// `[N, 12]`.
    flats: CubeTensor,
    tiles: Tiles,
}

impl Flattened {
    /// `[T + 1]`.
    fn starts(&self, client: &Client) -> BufferArg {
        let starts = self.tiles.starts.iter().map(|start| *start as u32);
        upload(client, &starts.collect::<Vec<_>>())
    }

    /// A group of threads for each tile.
    fn groups(&self, sight: &Sight) -> (CubeCount, CubeDim) {
        let (across, down) = Tiles::sides(sight.width, sight.height);
        (
            CubeCount::new_2d(across as u32, down as u32),
            CubeDim::new_1d(THREADS as u32),
        )
    }
}

/// `flats` `[N, 12]` in host memory.
///
/// # Panics
/// If the device can't be read.
fn host(flats: &CubeTensor) -> Vec<Flat> {
    if flats.meta.num_elements() == 0 {
        return Vec::new();
    }
    let bytes = flats.client.read_one(flats.handle.clone());
    let bytes = bytes.expect("a device that works");
    let numbers = f32::from_bytes(&bytes).as_chunks::<FLAT>().0.iter();
    numbers.map(flatten::of_numbers).collect()
}

/// `[H W, 4]` as in [`super::splat`].
fn forward(inputs: &Inputs, sight: &Sight) -> CubeTensor {
    let flattened = inputs.flattened(sight);
    if flattened.tiles.entries.is_empty() {
        return zeros(&inputs.rows, super::output_shape(sight));
    }
    let picture = empty(&inputs.rows, super::output_shape(sight));
    let client = &inputs.client;
    let (count, dim) = flattened.groups(sight);
    blend_tiles::launch(
        client,
        count,
        dim,
        flattened.flats.clone().into_buffer_arg(),
        flattened.starts(client),
        upload(client, &flattened.tiles.entries),
        picture.clone().into_buffer_arg(),
        sight.width,
        sight.height,
    );
    picture
}

/// Gradients to transforms `[N, 12]`, rows `[N, 14]` and light `[3, 8]`, from the `picture` and the
/// gradient to it, both `[H W, 4]`.
fn backward(
    inputs: &Inputs,
    picture: CubeTensor,
    grad: CubeTensor,
    sight: &Sight,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let n = inputs.count();
    let (client, beside) = (&inputs.client, &inputs.rows);
    let shapes = [Shape::new([n, 12]), Shape::new([n, ROW])];
    let to_light = zeros(beside, Shape::new([3, LIGHTS]));
    let flattened = inputs.flattened(sight);
    if flattened.tiles.entries.is_empty() {
        let [to_transforms, to_rows] = shapes.map(|shape| zeros(beside, shape));
        return (to_transforms, to_rows, to_light);
    }
    let to_splats = zeros(beside, Shape::new([n, SUMS]));
    let (count, dim) = flattened.groups(sight);
    launch_adding!(
        unblend_tiles,
        client,
        count,
        dim,
        flattened.flats.clone().into_buffer_arg(),
        flattened.starts(client),
        upload(client, &flattened.tiles.entries),
        rows(picture).into_buffer_arg(),
        rows(grad).into_buffer_arg(),
        to_splats.clone().into_buffer_arg(),
        sight.width,
        sight.height,
    );
    let [to_transforms, to_rows] = shapes.map(|shape| empty(beside, shape));
    let dim = CubeDim::new_1d(GROUP as u32);
    launch_adding!(
        unflatten_splats,
        client,
        calculate_cube_count_elemwise(client, n, dim),
        dim,
        inputs.transforms.clone().into_buffer_arg(),
        inputs.rows.clone().into_buffer_arg(),
        inputs.light.clone().into_buffer_arg(),
        upload(client, &lift::numbers(sight)),
        to_splats.into_buffer_arg(),
        to_transforms.clone().into_buffer_arg(),
        to_rows.clone().into_buffer_arg(),
        to_light.clone().into_buffer_arg(),
    );
    (to_transforms, to_rows, to_light)
}

//! Splatting on a GPU: projection with a thread per splat, rasterization with a group of threads per tile, and
//! the backward pass in reverse.
//!
//! Between the two, the projected splats are read into host memory, where they are sorted and binned into tiles
//! as on the CPU. For the 20,000 splats of a person that is a megabyte and about a millisecond, and
//! a training step reads the loss from the device anyway; sorting on the device would need a list of a
//! size that only the device knows. The backward pass projects and bins them again.

mod project;
mod project_backward;
mod projection;
mod rasterize;
mod rasterize_backward;
mod tile_row;
mod vectors;

use super::light::LIGHTS;
use super::projected::Projected;
use super::tiles::Tiles;
use super::{ROW, SplatOps, View};
use crate::cube::adding::launch_adding;
use crate::cube::tensors::{each, empty, rows, upload, zeros};
use burn::backend::tensor::FloatTensor;
use burn::tensor::Shape;
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use cubecl::calculate_cube_count_elemwise;
use cubecl::prelude::*;
use project::{PROJECTED_ROW, project_splats};
use project_backward::{GROUP, project_splats_backward};
use rasterize::rasterize_tiles;
use rasterize_backward::{SUMS, rasterize_tiles_backward};
use tile_row::THREADS;

impl SplatOps for CubeBackend {
    fn splat(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        view: View,
    ) -> FloatTensor<Self> {
        forward(&Inputs::new(transforms, rows, light), &view)
    }

    fn splat_backward(
        transforms: FloatTensor<Self>,
        rows: FloatTensor<Self>,
        light: FloatTensor<Self>,
        picture: FloatTensor<Self>,
        grad: FloatTensor<Self>,
        view: View,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        backward(&Inputs::new(transforms, rows, light), picture, grad, &view)
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

    /// Projects the splats and bins them into tiles.
    fn project_and_bin(&self, view: &View) -> Binned {
        let n = self.count();
        let projected = empty(&self.rows, Shape::new([n, PROJECTED_ROW]));
        if n > 0 {
            let (count, dim) = each(&self.client, n);
            project_splats::launch(
                &self.client,
                count,
                dim,
                self.transforms.clone().into_buffer_arg(),
                self.rows.clone().into_buffer_arg(),
                self.light.clone().into_buffer_arg(),
                upload(&self.client, &projection::numbers(view)),
                projected.clone().into_buffer_arg(),
            );
        }
        let tiles = Tiles::new(&host(&projected), view.width, view.height);
        Binned { projected, tiles }
    }
}

/// The projected splats and the tiles that they are in.
struct Binned {
    /// `[N, 12]`.
    projected: CubeTensor,
    tiles: Tiles,
}

impl Binned {
    /// `[T + 1]`.
    fn starts(&self, client: &Client) -> BufferArg {
        let starts = self.tiles.starts.iter().map(|start| *start as u32);
        upload(client, &starts.collect::<Vec<_>>())
    }

    /// The launch size of rasterization: a group of threads per tile.
    fn groups(&self, view: &View) -> (CubeCount, CubeDim) {
        let (across, down) = Tiles::sides(view.width, view.height);
        (
            CubeCount::new_2d(across as u32, down as u32),
            CubeDim::new_1d(THREADS as u32),
        )
    }
}

/// `projected` `[N, 12]` in host memory.
///
/// # Panics
/// If the device can't be read.
fn host(projected: &CubeTensor) -> Vec<Projected> {
    if projected.meta.num_elements() == 0 {
        return Vec::new();
    }
    let bytes = projected.client.read_one(projected.handle.clone());
    let bytes = bytes.expect("a device that works");
    let numbers = f32::from_bytes(&bytes)
        .as_chunks::<PROJECTED_ROW>()
        .0
        .iter();
    numbers.map(project::of_numbers).collect()
}

/// `[H W, 4]` as in [`super::splat`].
fn forward(inputs: &Inputs, view: &View) -> CubeTensor {
    let binned = inputs.project_and_bin(view);
    if binned.tiles.entries.is_empty() {
        return zeros(&inputs.rows, super::output_shape(view));
    }
    let picture = empty(&inputs.rows, super::output_shape(view));
    let client = &inputs.client;
    let (count, dim) = binned.groups(view);
    rasterize_tiles::launch(
        client,
        count,
        dim,
        binned.projected.clone().into_buffer_arg(),
        binned.starts(client),
        upload(client, &binned.tiles.entries),
        picture.clone().into_buffer_arg(),
        view.width,
        view.height,
    );
    picture
}

/// Gradients to transforms `[N, 12]`, rows `[N, 14]` and light `[3, 8]`, from the `picture` and the
/// gradient to it, both `[H W, 4]`.
fn backward(
    inputs: &Inputs,
    picture: CubeTensor,
    grad: CubeTensor,
    view: &View,
) -> (CubeTensor, CubeTensor, CubeTensor) {
    let n = inputs.count();
    let (client, beside) = (&inputs.client, &inputs.rows);
    let shapes = [Shape::new([n, 12]), Shape::new([n, ROW])];
    let to_light = zeros(beside, Shape::new([3, LIGHTS]));
    let binned = inputs.project_and_bin(view);
    if binned.tiles.entries.is_empty() {
        let [to_transforms, to_rows] = shapes.map(|shape| zeros(beside, shape));
        return (to_transforms, to_rows, to_light);
    }
    let to_splats = zeros(beside, Shape::new([n, SUMS]));
    let (count, dim) = binned.groups(view);
    launch_adding!(
        rasterize_tiles_backward,
        client,
        count,
        dim,
        binned.projected.clone().into_buffer_arg(),
        binned.starts(client),
        upload(client, &binned.tiles.entries),
        rows(picture).into_buffer_arg(),
        rows(grad).into_buffer_arg(),
        to_splats.clone().into_buffer_arg(),
        view.width,
        view.height,
    );
    let [to_transforms, to_rows] = shapes.map(|shape| empty(beside, shape));
    let dim = CubeDim::new_1d(GROUP as u32);
    launch_adding!(
        project_splats_backward,
        client,
        calculate_cube_count_elemwise(client, n, dim),
        dim,
        inputs.transforms.clone().into_buffer_arg(),
        inputs.rows.clone().into_buffer_arg(),
        inputs.light.clone().into_buffer_arg(),
        upload(client, &projection::numbers(view)),
        to_splats.into_buffer_arg(),
        to_transforms.clone().into_buffer_arg(),
        to_rows.clone().into_buffer_arg(),
        to_light.clone().into_buffer_arg(),
    );
    (to_transforms, to_rows, to_light)
}

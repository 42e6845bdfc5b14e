"""Writes captures/: see README.md."""

import json
import pickle
import shutil
from pathlib import Path

import h5py
import numpy as np
import scipy.sparse
from PIL import Image

import body as b
import bvh_dialects
import python2

HERE = Path(__file__).resolve().parent
OUT = HERE / "captures"
RNG = np.random.default_rng(7)
BODY = b.Body(RNG)
EXPECTED = {}
WIDTH, HEIGHT = 96, 128
K = np.array([[110.0, 0, 47.2], [0, 112.0, 63.7], [0, 0, 1]])
LENS = np.array([-0.12, 0.05, 0.002, -0.001, 0.01])


def pose(root):
    poses = RNG.normal(0, 0.25, 72)
    poses[:3] = root
    return poses


def picture(folder, name, pixels, kind):
    """An image of a bright person before a background, and a mask of the area near joints."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    near = np.zeros((HEIGHT, WIDTH), bool)
    for u, v in pixels:
        near |= (x - u) ** 2 + (y - v) ** 2 <= 9
    if kind == "image":
        rgb = np.stack([np.where(near, 220, 40 + x // 2), np.where(near, 180, 60 + y // 2),
                        np.where(near, 140, 90)], -1)
        Image.fromarray(rgb.astype(np.uint8)).save(path, quality=95)
    return near


def expect(name, frames, distortion=None):
    EXPECTED[name] = {
        "image_size": [WIDTH, HEIGHT],
        "distortion": list(map(float, distortion)) if distortion is not None else [0.0] * 5,
        "frames": [np.asarray(f).tolist() for f in frames],
    }


def body_models():
    folder = OUT / "smpl"
    folder.mkdir(parents=True)
    arrays = {
        "v_template": BODY.v_template,
        "shapedirs": BODY.shapedirs,
        "posedirs": RNG.normal(0, 1e-3, (4, 3, 207)),
        "kintree_table": np.array([[2**32 - 1] + b.PARENTS[1:], range(24)], np.uint32),
        "f": np.arange(12, dtype=np.uint32).reshape(4, 3),
    }
    np.savez(folder / "model.npz", J_regressor=BODY.regressor, **arrays)
    sparse = scipy.sparse.csc_matrix(BODY.regressor)
    sparse._shape = sparse.shape
    state = {name: getattr(sparse, name) for name in ("data", "indices", "indptr", "_shape")}
    plain = type("csc_matrix", (), {"__module__": "scipy.sparse._csc"})()
    plain.__dict__.update(state, format="csc", maxprint=50)
    old = dict(arrays, J_regressor=plain, shapedirs=b.chumpy_variable(BODY.shapedirs),
               bs_style="lbs", bs_type="lrotmin")
    for protocol in (0, 2):
        (folder / f"model-python2-{protocol}.pkl").write_bytes(python2.dumps(old, protocol))
    new = dict(arrays, J_regressor=scipy.sparse.csr_matrix(BODY.regressor))
    (folder / "model-python3.pkl").write_bytes(pickle.dumps(new))
    betas = RNG.normal(0, 1, 10)
    EXPECTED["smpl"] = {"betas": betas.tolist(), "joints": BODY.rest(betas).tolist()}


def rig(cameras):
    """Cameras around the origin, OpenCV's axes; translations in millimetres."""
    rs, ts = [], []
    for at in range(cameras):
        turn = b.rodrigues([0, 2 * np.pi * at / cameras, 0]) @ b.rodrigues([np.pi, 0, 0])
        r = turn.T
        rs.append(r)
        ts.append((np.array([0.1, 0.05, 2.6]) * 1000).reshape(3, 1))
    return rs, ts


def zju(folder_name, number_in_name):
    folder = OUT / folder_name
    (folder / "new_params").mkdir(parents=True)
    cameras, frames = 23, 3
    rs, ts = rig(cameras)
    ims, tracks = [], {0: [], 1: []}
    for i in range(frames):
        betas = RNG.normal(0, 0.5, 10)
        # The root is in Rh, as in the dataset; the second capture also has one in poses.
        poses = pose([0.2, -0.1, 0.1] if number_in_name else [0, 0, 0])
        rh, th = RNG.normal(0, 0.4, 3), np.array([0.05 * i, 0.1, -0.05])
        joints = BODY.posed(poses, betas) @ b.rodrigues(rh).T + th
        n = i + 1 if number_in_name else i
        np.save(folder / f"new_params/{n}.npy",
                {"poses": poses[None].astype(np.float32), "shapes": betas[None].astype(np.float32),
                 "Rh": rh[None].astype(np.float32), "Th": th[None].astype(np.float32)})
        paths = []
        for camera in range(cameras):
            if number_in_name:
                stamp = f"2019-08-23_16-08-50.{500 + i}"
                at = f"Camera ({camera + 1})"
                name = f"{at}/CoreView_313_Camera_({camera + 1})_{i + 1:04d}_{stamp}.jpg"
            else:
                name = f"Camera_B{camera + 1}/{i:06d}.jpg"
            paths.append(name)
            if camera > 1:
                continue
            e = np.eye(4)
            e[:3, :3], e[:3, 3:] = rs[camera], ts[camera] / 1000
            tracks[camera].append(b.project(joints, K, e))
            near = picture(folder, name, b.distorted(joints, K, e, LENS), "image")
            # Two label images that only together cover the person.
            for kind, rows in (("mask", slice(0, HEIGHT // 2)), ("mask_cihp", slice(40, None))):
                label = np.zeros((HEIGHT, WIDTH), np.uint8)
                label[rows] = near[rows] * (1 if kind == "mask" else 13)
                path = (folder / kind / name).with_suffix(".png")
                path.parent.mkdir(parents=True, exist_ok=True)
                Image.fromarray(label).save(path)
        ims.append({"ims": paths, "kpts2d": np.zeros((2, 3), np.float32)})
    annots = {"cams": {"K": [K] * cameras, "D": [LENS.reshape(5, 1)] * cameras, "R": rs, "T": ts},
              "ims": ims}
    np.save(folder / "annots.npy", annots)
    expect(folder_name, tracks[0], LENS)
    expect(folder_name + "@1", tracks[1], LENS)


def wild():
    """metadata.json, and the output of HumanNeRF's prepare_wild for it."""
    folder = OUT / "humannerf_wild"
    metadata, tracks, cameras, infos, all_betas = {}, [], {}, {}, []
    for i in range(2):
        name = f"frame_{i:06d}"
        poses, betas = pose([np.pi - 0.3, 0.2, 0.1 * i]), RNG.normal(0, 0.5, 10)
        e = np.eye(4)
        e[:3, :3] = b.rodrigues([0.05, 0.1, 0])
        e[:3, 3] = [0.1, 0.2, 2.5 + 0.1 * i]
        pixels = b.project(BODY.posed(poses, betas), K, e)
        tracks.append(pixels)
        metadata[name] = {"poses": poses.tolist(), "betas": betas.tolist(),
                          "cam_intrinsics": K.tolist(), "cam_extrinsics": e.tolist()}
        near = picture(folder, f"images/{name}.png", pixels, "image")
        (folder / "masks").mkdir(exist_ok=True)
        Image.fromarray((near * 255).astype(np.uint8)).convert("RGB").save(
            folder / f"masks/{name}.png")
        rest = BODY.rest(betas)
        rootless = poses.copy()
        rootless[:3] = 0
        infos[name] = {"Rh": poses[:3].astype(np.float32), "Th": rest[0].astype(np.float32),
                       "poses": rootless.astype(np.float32),
                       "joints": (BODY.posed(rootless, betas) - rest[0]).astype(np.float32),
                       "tpose_joints": (rest - rest[0]).astype(np.float32)}
        cameras[name] = {"intrinsics": K.astype(np.float32), "extrinsics": e.astype(np.float32)}
        all_betas.append(betas)
    (folder / "metadata.json").write_text(json.dumps(metadata))
    expect("humannerf_wild", tracks)
    prepared(OUT / "humannerf_wild_prepared", folder, cameras, infos, all_betas)
    expect("humannerf_wild_prepared", tracks)


def prepared(folder, pictures, cameras, infos, betas):
    folder.mkdir(parents=True, exist_ok=True)
    for kind in ("images", "masks"):
        if pictures != folder:
            shutil.copytree(pictures / kind, folder / kind)
    for name, value in (("cameras", cameras), ("mesh_infos", infos),
                        ("canonical_joints", {"joints": BODY.rest(np.mean(betas, 0))})):
        (folder / f"{name}.pkl").write_bytes(pickle.dumps(value))


def zju_prepared():
    """The output of HumanNeRF's prepare_zju_mocap: with a lens, without a root rotation in poses."""
    folder = OUT / "humannerf_zju_prepared"
    cameras, infos, tracks, all_betas = {}, {}, [], []
    rs, ts = rig(23)
    e = np.eye(4)
    e[:3, :3], e[:3, 3:] = rs[0], ts[0] / 1000
    for i in range(2):
        name = f"frame_{i:06d}"
        poses, betas = pose([0, 0, 0]), RNG.normal(0, 0.5, 10)
        rh, th = RNG.normal(0, 0.4, 3), np.array([0.0, 0.1 * i, 0.05])
        inner = BODY.posed(poses, betas)
        joints = inner @ b.rodrigues(rh).T + th
        tracks.append(b.project(joints, K, e))
        near = picture(folder, f"images/{name}.png", b.distorted(joints, K, e, LENS), "image")
        (folder / "masks").mkdir(exist_ok=True)
        Image.fromarray((near * 255).astype(np.uint8)).convert("RGB").save(
            folder / f"masks/{name}.png")
        infos[name] = {"Rh": rh.astype(np.float32), "Th": th.astype(np.float32),
                       "poses": poses.astype(np.float32), "joints": inner.astype(np.float32),
                       "tpose_joints": BODY.rest(betas).astype(np.float32)}
        cameras[name] = {"intrinsics": K.astype(np.float32), "extrinsics": e,
                         "distortions": LENS.astype(np.float32)}
        all_betas.append(betas)
    prepared(folder, folder, cameras, infos, all_betas)
    expect("humannerf_zju_prepared", tracks, LENS.astype(np.float32))


def snapshot_and_instant_avatar():
    folder, other = OUT / "people_snapshot/x-1-test", OUT / "instant_avatar"
    folder.mkdir(parents=True)
    (other / "masks").mkdir(parents=True)
    betas, frames = RNG.normal(0, 0.5, 10), 4
    rt, t = np.array([0.02, -0.03, 0.01]), np.array([0.01, 0.02, 0.03])
    e = np.eye(4)
    e[:3, :3], e[:3, 3] = b.rodrigues(rt), t
    poses = np.array([pose([np.pi, 0.1 * i, 0.05]) for i in range(frames)])
    trans = np.array([[0.02 * i, 0.3, 2.4] for i in range(frames)])
    camera = {"camera_f": np.array([K[0, 0], K[1, 1]]), "camera_c": K[:2, 2].copy(),
              "camera_k": LENS, "camera_rt": rt, "camera_t": t, "width": WIDTH, "height": HEIGHT}
    (folder / "camera.pkl").write_bytes(python2.dumps(camera, 0))
    masks, tracks = [], []
    for i in range(frames):
        joints = BODY.posed(poses[i], betas) + trans[i]
        tracks.append(b.project(joints, K, e))
        masks.append(picture(folder, f"images/image_{i:04d}.png",
                             b.distorted(joints, K, e, LENS), "image"))
        near = picture(other, f"images/image_{i:04d}.png", tracks[i], "image")
        np.save(other / f"masks/mask_{i:04d}.npy", near.astype(np.uint8))
    with h5py.File(folder / "masks.hdf5", "w") as file:
        file.create_dataset("masks", data=np.array(masks).astype(np.uint8), compression="gzip",
                            chunks=(1, 64, 48))
    with h5py.File(folder / "reconstructed_poses.hdf5", "w") as file:
        file.create_dataset("pose", data=poses.astype(np.float32))
        file.create_dataset("trans", data=trans.astype(np.float32))
        file.create_dataset("betas", data=betas.astype(np.float32))
    # The subject with a video in place of its frames. Importers copy videos without decoding, so
    # only a file's name and bytes matter here.
    film = OUT / "people_snapshot/x-2-film"
    film.mkdir()
    for name in ("camera.pkl", "masks.hdf5", "reconstructed_poses.hdf5"):
        shutil.copy(folder / name, film / name)
    (film / "x-2-film.mp4").write_bytes(b"\0\0\0\x18ftypmp42 not decoded by importers")
    expect("people_snapshot/x-1-test", tracks, LENS)
    expect("people_snapshot/x-2-film", tracks, LENS)

    np.savez(other / "cameras.npz", intrinsic=K, extrinsic=e, height=HEIGHT, width=WIDTH)
    np.savez(other / "poses.npz", betas=betas.astype(np.float32),
             thetas=poses.astype(np.float32), transl=trans.astype(np.float32))
    (other / "poses").mkdir()
    split = slice(0, 4, 2)
    np.savez(other / "poses/train.npz", betas=betas[None].astype(np.float32),
             global_orient=poses[split, :3].astype(np.float32),
             body_pose=poses[split, 3:].astype(np.float32), transl=trans[split].astype(np.float32))
    expect("instant_avatar", tracks)


def amass():
    folder = OUT / "amass"
    folder.mkdir()
    frames, betas = 5, RNG.normal(0, 0.5, 16)
    poses = np.concatenate([np.array([pose([np.pi / 2, 0.1 * i, 0]) for i in range(frames)])[:, :66],
                            RNG.normal(0, 0.2, (frames, 90))], 1)
    trans = np.array([[0.1 * i, 0.02 * i, 0.9] for i in range(frames)])
    np.savez(folder / "walk_poses.npz", poses=poses, trans=trans, betas=betas,
             mocap_framerate=np.array(120.0), gender=np.array("female"), dmpls=np.zeros((frames, 8)))
    np.savez_compressed(folder / "bare.npz", poses=poses[:, :72].astype(np.float32),
                        trans=trans.astype(np.float32))
    body_poses = np.concatenate([poses[:, :66], np.zeros((frames, 6))], 1)
    world = [BODY.posed(p, betas[:10]) + t for p, t in zip(body_poses, trans)]
    # z up to y up: (x, y, z) to (x, z, -y).
    up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    EXPECTED["amass"] = [(joints @ up.T).tolist() for joints in world]


# Name, parent, offset (centimetres): arms hang half down, so this is not a T-pose.
BVH = [
    ("mixamorig:Hips", None, (0, 95, 0)), ("mixamorig:Spine", 0, (0, 10, 0)),
    ("mixamorig:Spine1", 1, (0, 12, 0)), ("mixamorig:Spine2", 2, (0, 12, 0)),
    ("mixamorig:Neck", 3, (0, 15, 0)), ("mixamorig:Head", 4, (0, 10, 2)),
    ("mixamorig:LeftShoulder", 3, (5, 10, 0)), ("mixamorig:LeftArm", 6, (12, 0, 0)),
    ("mixamorig:LeftForeArm", 7, (20, -20, 0)), ("mixamorig:LeftHand", 8, (18, -18, 0)),
    ("mixamorig:RightShoulder", 3, (-5, 10, 0)), ("mixamorig:RightArm", 10, (-12, 0, 0)),
    ("mixamorig:RightForeArm", 11, (-20, -20, 0)), ("mixamorig:RightHand", 12, (-18, -18, 0)),
    ("mixamorig:LeftUpLeg", 0, (9, -5, 0)), ("mixamorig:LeftLeg", 14, (1, -42, 0)),
    ("mixamorig:LeftFoot", 15, (0, -41, 0)), ("mixamorig:LeftToeBase", 16, (0, -6, 14)),
    ("mixamorig:RightUpLeg", 0, (-9, -5, 0)), ("mixamorig:RightLeg", 18, (-1, -42, 0)),
    ("mixamorig:RightFoot", 19, (0, -41, 0)), ("mixamorig:RightToeBase", 20, (0, -6, 14)),
    ("Prop_Bag", 3, (0, 0, -20)),
]


def bvh():
    folder = OUT / "bvh"
    folder.mkdir()
    lines = ["HIERARCHY"]

    def joint(at, depth):
        name, parent, offset = BVH[at]
        pad = "\t" * depth
        children = [c for c, (_, p, _) in enumerate(BVH) if p == at]
        lines.append(f"{pad}{'ROOT' if parent is None else 'JOINT'} {name}")
        lines.append(pad + "{")
        lines.append(f"{pad}\tOFFSET {offset[0]:.4f} {offset[1]:.4f} {offset[2]:.4f}")
        position = "Xposition Yposition Zposition " if parent is None else ""
        lines.append(f"{pad}\tCHANNELS {6 if parent is None else 3} {position}"
                     "Zrotation Xrotation Yrotation")
        order.append(at)
        for child in children:
            joint(child, depth + 1)
        if not children:
            lines.extend([pad + "\tEnd Site", pad + "\t{", pad + "\t\tOFFSET 0 5 0", pad + "\t}"])
        lines.append(pad + "}")

    order = []
    joint(0, 0)
    frames = 3
    lines += ["MOTION", f"Frames: {frames}", "Frame Time: 0.0333333"]
    expected = []
    for i in range(frames):
        angles = {at: RNG.uniform(-60, 60, 3) for at in order}
        root = np.array([3.0 * i, 95.0, 10.0 * i])
        row = []
        for at in order:
            if at == 0:
                row.extend(root)
            row.extend(angles[at])
        lines.append(" ".join(f"{v:.6f}" for v in row))
        rotations, places = {}, {}
        for at in order:
            z, x, y = np.radians(angles[at])
            local = b.rodrigues([0, 0, z]) @ b.rodrigues([x, 0, 0]) @ b.rodrigues([0, y, 0])
            _, parent, offset = BVH[at]
            if parent is None:
                rotations[at], places[at] = local, root
            else:
                rotations[at] = rotations[parent] @ local
                places[at] = places[parent] + rotations[parent] @ np.array(offset, float)
        expected.append({BVH[at][0]: places[at].tolist() for at in order})
    (folder / "mixamo.bvh").write_text("\n".join(lines) + "\n")
    EXPECTED["bvh"] = expected


def main():
    if OUT.exists():
        shutil.rmtree(OUT)
    body_models()
    zju("CoreView_377", False)
    zju("CoreView_313", True)
    wild()
    zju_prepared()
    snapshot_and_instant_avatar()
    amass()
    bvh()
    bvh_dialects.write()
    rounded = json.loads(json.dumps(EXPECTED), parse_float=lambda text: round(float(text), 7))
    (OUT / "expected.json").write_text(json.dumps(rounded))


main()

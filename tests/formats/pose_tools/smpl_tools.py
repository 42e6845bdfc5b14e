"""Files of the tools that fit SMPL or SMPL-X, written with their own libraries."""

import json

import joblib
import numpy as np
import torch
from pycocotools import mask as coco

import body as b
import truth as t

F32 = np.float32
# Vertices stand in for the thousands of the models.
VERTICES = 24


def rle(mask):
    return coco.encode(np.asfortranarray(mask.astype(np.uint8)))


def verts(person, frame, with_t=False):
    """Points around the joints."""
    joints = person.joints[frame] if with_t else person.posed[frame]
    return np.resize(joints, (VERTICES, 3)).astype(F32)


def expect(tool, k, rows):
    """What a reader of the tool's file should see: per person, the frames; and joints and their pixels
    where the tool's camera or digits make them other than the truth."""
    people = []
    for name, person, frames, joints in rows:
        frames, joints = list(frames), np.asarray(joints)
        people.append({"name": name, "person": person.number, "frames": frames})
        if np.abs(joints - person.joints[frames]).max() > 1e-6:
            people[-1] |= {"joints": joints.tolist(), "pixels": [t.project(j, k).tolist() for j in joints]}
    return {tool: {"k": k.tolist(), "people": people}}


def phalp(folder):
    """4D-Humans: joblib with zlib, lists per person, ghosts of a person lost two frames ago."""
    side = max(t.WIDTH, t.HEIGHT)
    k = t.pinhole(5000 / 256 * side)
    centred = np.array([(side - t.WIDTH) // 2, (side - t.HEIGHT) // 2])
    out, seen, ghost = {}, {1: [], 2: []}, None

    def entry(person, frame):
        shift = t.placed(person.posed[frame], person.pixels[frame], k)
        x0, y0, x1, y1 = person.box(frame)
        r = person.matrices(frame).astype(F32)
        joints = person.posed[frame]
        points = person.points(frame)
        order = ["nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow",
                 "left_wrist", "pelvis", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle",
                 "right_eye", "left_eye", "right_ear", "left_ear", "left_big_toe", "left_small_toe", "left_heel",
                 "right_big_toe", "right_small_toe", "right_heel",
                 # The 19 of SMPL_to_J19.
                 "right_ankle", "right_knee", "right_hip", "left_hip", "left_knee", "left_ankle", "right_wrist",
                 "right_elbow", "right_shoulder", "left_shoulder", "left_elbow", "left_wrist", "neck", "head_top", "nose",
                 "left_eye", "right_eye", "left_ear", "right_ear"]
        local = np.array([points[name] for name in order]) - person.t[frame]
        # The last is the origin itself.
        local = np.vstack([local, np.zeros(3)])
        flat = (t.project(local + shift, k) + centred) / side
        return joints + shift, {
            "bbox": np.array([x0, y0, x1 - x0, y1 - y0]), "mask": rle(person.mask(frame)), "conf": 0.98,
            "smpl": {"global_orient": r[:1], "body_pose": r[1:], "betas": np.zeros(10, F32)},
            "camera": shift.astype(F32), "camera_bbox": np.array([0.9, 0.01, 0.02], F32),
            "3d_joints": local.astype(F32), "2d_joints": flat.reshape(-1).astype(F32),
            "center": np.array([(x0 + x1) / 2, (y0 + y1) / 2]), "scale": np.array([x1 - x0, y1 - y0]),
            "size": [t.HEIGHT, t.WIDTH], "img_name": f"{frame:06d}.jpg", "class_name": 0,
        }

    for frame in range(t.FRAMES):
        path = f"outputs//_DEMO/walk/img/{frame:06d}.jpg"
        people = [(1, t.FIRST, frame, 0)]
        if frame in t.SEEN:
            people.append((2, t.SECOND, frame, 0))
            ghost = frame
        elif ghost is not None and frame - ghost <= 2:
            people.append((2, t.SECOND, ghost, frame - ghost))
        record = {"time": frame, "shot": 0, "frame_path": path, "tracked_ids": [], "tracked_bbox": [], "tid": [],
                  "bbox": [], "tracked_time": []}
        # The second is found first where both are seen.
        for tid, person, data, since in reversed(people):
            joints, fields = entry(person, data)
            for name, value in fields.items():
                record.setdefault(name, []).append(value)
            record["tid"].append(tid)
            record["tracked_time"].append(since)
            if since == 0:
                record["tracked_ids"].append(tid)
                record["tracked_bbox"].append(fields["bbox"])
                seen[tid].append((frame, joints))
        out[path] = record
    file = folder / "phalp/outputs/results/demo_walk.pkl"
    file.parent.mkdir(parents=True)
    joblib.dump(out, file, compress=3)
    rows = [(tid, person, [f for f, _ in seen[tid]], [j for _, j in seen[tid]])
            for tid, person in ((1, t.FIRST), (2, t.SECOND))]
    return expect("phalp", k, rows)


def wham(folder):
    """wham_output.pkl: joblib without compression, and a world that must not be used."""
    out, rows = {}, []
    for name, person, frames in ((0, t.FIRST, range(t.FRAMES)), (1, t.SECOND, t.SEEN)):
        frames = list(frames)
        up = b.rodrigues([np.pi, 0, 0])
        world = person.poses[frames].copy()
        world[:, :3] = [t.vector(up @ b.rodrigues(pose[:3])) for pose in world]
        # The y-up world begins at the hips' first place.
        start = person.joints[frames[0]][[1, 2]].mean(0)
        out[name] = {
            "pose": person.poses[frames].astype(F32), "trans": person.t[frames].astype(F32),
            "pose_world": world.astype(F32), "trans_world": ((person.t[frames] - start) @ up.T).astype(F32),
            "betas": np.zeros((len(frames), 10), F32),
            "verts": np.array([verts(person, f, True) for f in frames]),
            "frame_ids": np.array(frames),
        }
        rows.append((name, person, frames, person.joints[frames]))
    file = folder / "wham/output/demo/walk/wham_output.pkl"
    file.parent.mkdir(parents=True)
    joblib.dump(out, file)
    return expect("wham", t.K, rows)


def gvhmr(folder):
    """hmr4d_results.pt, and the pickle of a converter that loses the camera's values."""
    person = t.FIRST
    incam = {
        "body_pose": person.poses[:, 3:66], "global_orient": person.poses[:, :3],
        "transl": person.t, "betas": np.zeros((t.FRAMES, 10)),
    }
    up = b.rodrigues([np.pi, 0, 0])
    lifted = dict(incam, global_orient=np.array([t.vector(up @ b.rodrigues(v)) for v in person.poses[:, :3]]),
                  transl=(person.joints[:, 0] - person.joints[0, 0]) @ up.T - t.PELVIS + [0, 0.95, 0])
    tensors = lambda values: {name: torch.tensor(v, dtype=torch.float32) for name, v in values.items()}
    out = {
        "smpl_params_global": tensors(lifted), "smpl_params_incam": tensors(incam),
        # One camera for all frames, repeated without a copy.
        "K_fullimg": torch.tensor(t.K, dtype=torch.float32).expand(t.FRAMES, 3, 3),
        "net_outputs": {"static_conf_logits": torch.zeros(1, t.FRAMES, 6, dtype=torch.float16)},
    }
    outputs = folder / "gvhmr/outputs/demo/walk"
    outputs.mkdir(parents=True)
    torch.save(out, outputs / "hmr4d_results.pt")
    bad = dict(out, smpl_params_incam=out["smpl_params_global"])
    torch.save(bad, folder / "gvhmr/converted.pt", _use_new_zipfile_serialization=False)
    return expect("gvhmr", t.K, [(0, person, range(t.FRAMES), person.joints)])


def tram_cameras(sequence):
    """camera.npy of the versions that read gravity off a picture, and in cameras/ those of a later one,
    which does not, and of a camera that stands still. Camera to world, by kind of file."""
    (sequence.parent.parent / "cameras").mkdir(parents=True)
    turns = np.array([b.rodrigues([0, 0.01 * f, 0]) for f in range(t.FRAMES)], F32)
    steps = np.array([[0.02 * f, 0, 0.01 * f] for f in range(t.FRAMES)], F32)
    # The first camera is level: its axes, turned to y up, are the world's.
    up = np.diag([1, -1, -1]).astype(F32)
    own = {"img_focal": np.float64(t.FOCAL), "img_center": t.CENTRE}
    first = {"pred_cam_R": turns, "pred_cam_T": steps}
    world = {"world_cam_R": up @ turns, "world_cam_T": steps @ up.T}
    still = {"pred_cam_R": np.tile(np.eye(3, dtype=F32), (t.FRAMES, 1, 1)), "pred_cam_T": np.zeros((t.FRAMES, 3), F32)}
    np.save(sequence / "camera.npy", first | world | own | {"spec_focal": np.float64(t.FOCAL)})
    np.save(sequence.parent.parent / "cameras/later.npy", first | own)
    np.save(sequence.parent.parent / "cameras/still.npy", still | own)
    pairs = lambda turns, steps: [{"r": r.tolist(), "t": s.tolist()} for r, s in zip(turns, steps)]
    return {"world": pairs(world["world_cam_R"], world["world_cam_T"]), "first": pairs(turns, steps)}


def tram(folder):
    """Pickled tensors in .npy, one file a person; the camera moves."""
    sequence = folder / "tram/results/walk"
    (sequence / "hps").mkdir(parents=True)
    person, rows = t.FIRST, []
    r = torch.tensor(np.array([person.matrices(f) for f in range(t.FRAMES)]), dtype=torch.float32)
    track = {
        "pred_cam": torch.ones(t.FRAMES, 3), "pred_pose": r[..., :2].reshape(t.FRAMES, 144),
        "pred_shape": torch.zeros(t.FRAMES, 10), "pred_rotmat": r,
        "pred_trans": torch.tensor(person.t[:, None], dtype=torch.float32), "frame": torch.arange(t.FRAMES),
    }
    np.save(sequence / "hps/hps_track_0.npy", track)
    rows.append((0, person, range(t.FRAMES), person.joints))
    cameras = tram_cameras(sequence)
    masks = []
    for frame in range(t.FRAMES):
        mask = person.mask(frame)
        if frame in t.SEEN:
            mask = mask | t.SECOND.mask(frame)
        masks.append(rle(mask))
    np.save(sequence / "masks.npy", np.array(masks, dtype=object))
    expected = expect("tram", t.K, rows)
    expected["tram"]["camera_to_world"] = cameras
    return expected


def prompt_hmr(folder):
    """results.pkl of save_only_essential: joblib without compression."""
    people, rows = {}, []
    for tid, person, frames in ((1, t.FIRST, range(t.FRAMES)), (2, t.SECOND, t.SEEN)):
        frames = list(frames)
        r = np.tile(np.eye(3), (len(frames), 55, 1, 1))
        r[:, :22] = [person.matrices(f)[:22] for f in frames]
        pose = np.zeros((len(frames), 75))
        pose[:, :66] = person.poses[frames][:, :66]
        people[tid] = {
            "track_id": tid, "frames": np.array(frames), "bboxes": np.array([person.box(f) for f in frames], F32),
            "detected": np.ones(len(frames), bool),
            "smplx_cam": {
                "rotmat": r.astype(F32), "pose": pose.astype(F32), "shape": np.zeros((len(frames), 10), F32),
                "trans": person.t[frames].astype(F32), "contact": np.zeros((len(frames), 6), bool),
                "static_conf_logits": np.zeros((len(frames), 6), F32)},
        }
        rows.append((tid, person, frames, person.joints[frames]))
    still = np.tile(np.eye(3, dtype=F32), (t.FRAMES, 1, 1))
    out = {
        "camera": {"pred_cam_R": still, "pred_cam_T": np.zeros((t.FRAMES, 3), F32), "img_focal": np.float32(t.FOCAL),
                   "img_center": t.CENTRE.astype(F32)},
        "people": people, "timings": {},
        "has_tracks": True, "has_hps_cam": True, "contact_joint_ids": [7, 10, 8, 11, 20, 21],
    }
    file = folder / "prompt_hmr/results/walk/results.pkl"
    file.parent.mkdir(parents=True)
    joblib.dump(out, file)
    return expect("prompt_hmr", t.K, rows)


def lhm(folder):
    """JSON a frame: trans is the pelvis, and the camera is that of a padded and enlarged image."""
    person, pad, longest = t.FIRST, 0.2, 896
    padded = np.array([round((1 + pad) * t.WIDTH), round((1 + pad) * t.HEIGHT)])
    offset = (padded - [t.WIDTH, t.HEIGHT]) // 2
    scale = longest / padded.max()
    (folder / "lhm/smplx_params").mkdir(parents=True)
    for frame in range(t.FRAMES):
        pose = person.poses[frame].reshape(24, 3)
        out = {
            "betas": [0.0] * 10, "root_pose": pose[0].tolist(), "body_pose": pose[1:22].tolist(),
            "jaw_pose": [0.0] * 3, "leye_pose": [0.0] * 3, "reye_pose": [0.0] * 3,
            "lhand_pose": np.zeros((15, 3)).tolist(), "rhand_pose": np.zeros((15, 3)).tolist(),
            "trans": person.joints[frame, 0].tolist(),
            "focal": [t.FOCAL * scale] * 2, "princpt": ((t.CENTRE + offset) * scale).tolist(),
            "img_size_wh": np.round(padded * scale).tolist(), "pad_ratio": pad,
        }
        (folder / f"lhm/smplx_params/{frame + 1:05d}.json").write_text(json.dumps(out))
    return expect("lhm", t.K, [(0, person, range(t.FRAMES), person.joints)])


def ex_avatar(folder):
    """JSON a frame, from 0, in the axes of a virtual camera that stands still, of 2000 px; one shape."""
    person, root = t.FIRST, folder / "ex_avatar"
    k = t.pinhole(2000.0)
    (root / "smplx_optimized/smplx_params").mkdir(parents=True)
    (root / "cam_params").mkdir()
    joints = []
    for frame in range(t.FRAMES):
        pose = person.poses[frame].reshape(24, 3)
        shift = t.placed(person.posed[frame], person.pixels[frame], k)
        joints.append(person.posed[frame] + shift)
        out = {
            "root_pose": pose[0].tolist(), "body_pose": pose[1:22].tolist(), "jaw_pose": [0.0] * 3,
            "leye_pose": [0.0] * 3, "reye_pose": [0.0] * 3, "lhand_pose": np.zeros((15, 3)).tolist(),
            "rhand_pose": np.zeros((15, 3)).tolist(), "expr": [0.0] * 50, "trans": shift.tolist(),
        }
        (root / f"smplx_optimized/smplx_params/{frame}.json").write_text(json.dumps(out))
        camera = {"R": np.eye(3).tolist(), "t": [0.0] * 3, "focal": [2000, 2000], "princpt": [t.WIDTH / 2, t.HEIGHT / 2]}
        (root / f"cam_params/{frame}.json").write_text(json.dumps(camera))
    (root / "smplx_optimized/shape_param.json").write_text(json.dumps([0.0] * 100))
    (root / "smplx_optimized/joint_offset.json").write_text(json.dumps(np.zeros((55, 3)).tolist()))
    return expect("ex_avatar", k, [(0, person, range(t.FRAMES), joints)])

"""Files of detectors of key points in images."""

import csv
import json

import numpy as np

import truth as t

COCO = ["nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
        "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
        "right_ankle"]
BODY_25 = ["nose", "neck", "right_shoulder", "right_elbow", "right_wrist", "left_shoulder", "left_elbow", "left_wrist",
           "pelvis", "right_hip", "right_knee", "right_ankle", "left_hip", "left_knee", "left_ankle", "right_eye", "left_eye",
           "right_ear", "left_ear", "left_big_toe", "left_small_toe", "left_heel", "right_big_toe", "right_small_toe",
           "right_heel"]
MEDIAPIPE = ["nose", *["left_eye"] * 3, *["right_eye"] * 3, "left_ear", "right_ear", "nose", "nose", "left_shoulder",
             "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
             *["left_hand", "right_hand"] * 3, "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
             "right_ankle", "left_heel", "right_heel", "left_big_toe", "right_big_toe"]


def seen(frame):
    return [t.FIRST] + ([t.SECOND] if frame in t.SEEN else [])


def flat(person, frame, names):
    """Pixels [K, 2] of key points by name."""
    points = person.points(frame)
    return t.project([points[name] for name in names])


def openpose(folder):
    """write_json: a file a frame, people in no order; what is not seen is zeros."""
    (folder / "openpose").mkdir(parents=True)
    for frame in range(t.FRAMES):
        people = []
        for person in seen(frame)[:: 1 if frame % 2 else -1]:
            rows = np.hstack([flat(person, frame, BODY_25), np.full((25, 1), 0.85)])
            outside = (rows[:, 0] < 0) | (rows[:, 0] > t.WIDTH - 1) | (rows[:, 1] < 0) | (rows[:, 1] > t.HEIGHT - 1)
            rows[outside] = 0
            people.append({"person_id": [-1], "pose_keypoints_2d": np.round(rows, 4).reshape(-1).tolist(),
                           "face_keypoints_2d": [], "hand_left_keypoints_2d": [], "hand_right_keypoints_2d": [],
                           "pose_keypoints_3d": [], "face_keypoints_3d": [], "hand_left_keypoints_3d": [],
                           "hand_right_keypoints_3d": []})
        (folder / f"openpose/walk_{frame:012d}_keypoints.json").write_text(
            json.dumps({"version": 1.3, "people": people}, separators=(",", ":")))


def alphapose(folder):
    """alphapose-results.json: a list of people over all frames, with tracks in idx."""
    out = []
    for frame in range(t.FRAMES):
        for person in seen(frame):
            rows = np.hstack([flat(person, frame, COCO), np.full((17, 1), 0.9)])
            x0, y0, x1, y1 = person.box(frame)
            out.append({"image_id": f"{frame}.jpg", "category_id": 1, "keypoints": np.round(rows, 4).reshape(-1).tolist(),
                        "score": 2.9, "box": [x0, y0, x1 - x0, y1 - y0], "idx": person.number})
    (folder / "alphapose").mkdir(parents=True)
    (folder / "alphapose/alphapose-results.json").write_text(json.dumps(out))


def mmpose(folder):
    """--save-predictions: frames count from 1, and the box is in a list of its own."""
    out = []
    for frame in range(t.FRAMES):
        instances = [{
            "keypoints": np.round(flat(person, frame, COCO), 4).tolist(), "keypoint_scores": [0.9] * 17,
            "bbox": [person.box(frame).tolist()], "bbox_score": 0.95,
        } for person in seen(frame)]
        out.append({"frame_id": frame + 1, "instances": instances})
    names = {"dataset_name": "coco", "num_keypoints": 17, "keypoint_id2name": dict(enumerate(COCO)),
             "keypoint_name2id": {name: at for at, name in enumerate(COCO)}}
    (folder / "mmpose").mkdir(parents=True)
    (folder / "mmpose/results_walk.json").write_text(json.dumps({"meta_info": names, "instance_info": out}, indent="\t"))


def mediapipe(folder):
    """33 landmarks of the first person: x and y as shares of the image, z in the unit of x from the
    hips on; and metres around the hips. MediaPipe has no files: these are what its users write."""
    normal, world = [], []
    for frame in range(t.FRAMES):
        points = t.FIRST.points(frame)
        places = np.array([points[name] for name in MEDIAPIPE])
        middle = (points["left_hip"] + points["right_hip"]) / 2
        depth = (places[:, 2] - middle[2]) * t.FOCAL / middle[2]
        image = np.hstack([t.project(places), depth[:, None]]) / [t.WIDTH, t.HEIGHT, t.WIDTH]
        sure = np.full((33, 1), 0.99)
        normal.append(np.hstack([image, sure]))
        world.append(np.hstack([places - middle, sure]))
    (folder / "mediapipe").mkdir(parents=True)
    np.savez_compressed(folder / "mediapipe/landmarks.npz", landmarks=np.array(normal, np.float32),
                        world_landmarks=np.array(world, np.float32), size=np.array([t.WIDTH, t.HEIGHT]))
    named = lambda rows: [dict(zip(("x", "y", "z", "visibility"), map(float, np.round(row, 4)))) for row in rows]
    frames = [{"frame": f, "pose_landmarks": named(normal[f]), "pose_world_landmarks": named(world[f])}
              for f in range(t.FRAMES)]
    (folder / "mediapipe/landmarks.json").write_text(json.dumps(frames))
    with open(folder / "mediapipe/landmarks.csv", "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["frame"] + [f"{axis}{i}" for i in range(33) for axis in ("x", "y", "z", "v")])
        for f in range(t.FRAMES):
            rows.writerow([f, *np.round(normal[f].reshape(-1), 4).tolist()])

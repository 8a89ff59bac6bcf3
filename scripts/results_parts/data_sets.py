"""The data sets and the figures published for them."""

# name: (chi2 of the optimum, chi2 and seconds of the authors' program, RMSE of poses and of features
# as the paper prints them, number of local maps)
GRAPHS = {
    "intel_943": (546.4611, 546.51, 0.23, 0.0066, None, 942),
    "manhattan_3500": (137.9130, 214.12, 0.87, 1.115, None, 3499),
    "city_10000": (511.9852, 601.38, 5.79, 0.192, None, 9999),
    "sphere_2500": (1153.8544, 1364.0, 5.42, 1.304, None, 2499),
    "parking_garage_1661": (1.288830, 1.5978, 2.07, 1.604, None, 1660),
    "manhattan_3500_anisotropic": (3549.0368, None, None, None, None, 3499),
    "intel_1728": (45.004696, None, None, None, None, 1727),
    "csail_1045": (40.555129, None, None, None, None, 1044),
    "torus_5000": (24233.0187, None, None, None, None, 4999),
}
LANDMARKS = {
    "victoria_park": (9012.7196, 9020.55, 2.05, 0.1401, 0.2348, 6898),
    "dlr": (27688.5556, 28373.7, 0.64, 0.0976, 0.1042, 3298),
}
MAPS = {
    "victoria_park_200": (3643.4349, 3645.46, 0.36, 0.0391, 0.0643, 200),
    "dlr_200": (11163.6435, 12577.1, 0.11, 0.1537, 0.1545, 200),
    "victoria_park_6898": (9012.7196, 9020.55, 2.05, 0.1401, 0.2348, 6898),
    "dlr_3298": (27688.5556, 28373.7, 0.64, 0.0976, 0.1042, 3298),
    "simu_8240_50": (458.1544, 528.65, 0.07, None, None, 50),
    "simu_35188_700": (10315.6331, 10446.9, 0.92, None, None, 700),
    "intel_943": (546.4611, 546.51, 0.23, 0.0066, None, 942),
    "sphere_2500": (None, 1363.8, 5.42, 1.304, None, 2499),
    "simu3d_870": (None, 310.853, 1.18, None, None, 870),
}
REFERENCES = {"victoria_park": "local_maps/victoria_park_6898", "dlr": "local_maps/dlr_3298"}
PLANAR = lambda name: not name.startswith(("sphere", "parking", "torus", "simu3d"))

# The nine rows of pose graphs and Victoria Park / DLR sets that the paper prints.
ROWS = [("graph", n) for n in list(GRAPHS)[:5]] + [("maps", n) for n in list(MAPS)[:4]]
# The same and the simulated sets.
PAPER_ROWS = ROWS + [("maps", n) for n in ("simu_8240_50", "simu_35188_700", "simu3d_870",
                                           "sphere_2500")]


ALL = [("graph", n) for n in GRAPHS] + [("landmarks", n) for n in LANDMARKS]
ALL += [("maps", n) for n in MAPS]


def row(kind, name):
    return {"graph": GRAPHS, "landmarks": LANDMARKS, "maps": MAPS}[kind][name]


def label(kind, name):
    return name + {"graph": "", "landmarks": ".g2o", "maps": " (local maps)"}[kind]

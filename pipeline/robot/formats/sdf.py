def read(root, file, end_effector): raise NotImplementedError
